#include "vdbgeo/surface/label_surfaces.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/label_net.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using Vec3 = Eigen::Vector3f;

/// The neighbours of each vertex, one list after another. A vertex on a line between three labels or more
/// knows only its neighbours along such lines, so that it stays on them.
struct Neighbours {
    Array<std::uint64_t> first;
    Array<VertexId> ids;
};

Neighbours neighbours_of(const LabelNet& net) {
    const std::size_t n = net.vertices.size();
    std::vector<std::uint8_t> junctions(n, 0);
    for (const NetEdge& e : net.edges)
        for (const VertexId v : {e.a, e.b})
            if (e.junction) ++junctions[v];
    const auto takes = [&](VertexId v, const NetEdge& e) { return e.junction || junctions[v] < 2; };
    Neighbours out;
    out.first.assign(n + 1, 0);
    for (const NetEdge& e : net.edges)
        for (const VertexId v : {e.a, e.b}) out.first[v + 1] += takes(v, e);
    for (std::size_t v = 0; v < n; ++v) out.first[v + 1] += out.first[v];
    out.ids.resize(out.first[n]);
    Array<std::uint64_t> next(out.first.begin(), out.first.end() - 1);
    for (const NetEdge& e : net.edges) {
        if (takes(e.a, e)) out.ids[next[e.a]++] = e.b;
        if (takes(e.b, e)) out.ids[next[e.b]++] = e.a;
    }
    return out;
}

/// Taubin's smoothing (SIGGRAPH '95): a step along the Laplacian and a slightly longer one back, so that
/// waves with eigenvalues of the net's Laplacian below 1/shrink + 1/grow = 0.05 stay (some 15 voxels and
/// longer), and no part shrinks.
constexpr float shrink = 0.6f, grow = -1 / (1 / 0.6f - 0.05f);

Array<Vec3> smoothed(const LabelNet& net, int iterations, const Progress& progress) {
    Array<Vec3> points(net.vertices.size()), next(net.vertices.size());
    for (std::size_t v = 0; v < points.size(); ++v) points[v] = net.vertices[v].start;
    if (iterations == 0) return points;
    const Neighbours near = neighbours_of(net);
    for (int k = 0; k < iterations; ++k) {
        const float factor = k % 2 ? grow : shrink;
        parallel_for(points.size(), 4096, [&](std::size_t v) {
            const NetVertex& at = net.vertices[v];
            Vec3 mean = Vec3::Zero();
            for (std::uint64_t i = near.first[v]; i < near.first[v + 1]; ++i) mean += points[near.ids[i]];
            const auto count = near.first[v + 1] - near.first[v];
            Vec3 moved = points[v];
            if (count > 0) moved += factor * (mean / static_cast<float>(count) - moved);
            next[v] = moved.cwiseMax(at.low).cwiseMin(at.high);
        });
        points.swap(next);
        progress.report((k + 1.0) / iterations);
    }
    return points;
}

/// The polygons of one label as triangles over vertices of their own.
class LabelMesher {
 public:
    LabelMesher(const LabelNet& net, const Array<Vec3f>& points, bool mirrored)
        : net_(net), points_(points), mirrored_(mirrored), number_(points.size(), unset) {}

    template <class Polygons>
    TriMesh run(float label, const Polygons& polygons) {
        TriMesh mesh;
        out_ = &mesh;
        for (const std::uint64_t p : polygons) {
            const NetPolygon& polygon = net_.polygons[p];
            add(polygon, polygon.below == label, static_cast<VertexId>(net_.vertices.size() + p));
        }
        for (const VertexId v : used_) number_[v] = unset;
        used_.clear();
        further_.clear();
        return mesh;
    }

 private:
    static constexpr VertexId unset = 0xFFFFFFFFu;

    VertexId make(const Vec3f& at) {
        out_->points.push_back(at);
        return static_cast<VertexId>(out_->points.size() - 1);
    }

    /// The number of a vertex in the mesh. Sheets of the label that meet at the vertex are kept apart.
    VertexId number(VertexId v, unsigned sheet) {
        if (sheet == 0) {
            if (number_[v] == unset) {
                number_[v] = make(points_[v]);
                used_.push_back(v);
            }
            return number_[v];
        }
        const auto [it, fresh] = further_.try_emplace(std::uint64_t{v} * 4 + sheet, 0);
        if (fresh) it->second = make(points_[v]);
        return it->second;
    }

    void triangle(VertexId a, VertexId b, VertexId c, bool turn) {
        if (turn) std::swap(b, c);
        out_->triangles.push_back({a, b, c});
    }

    void add(const NetPolygon& polygon, bool label_is_below, VertexId centre) {
        const bool turn = label_is_below == mirrored_;
        const unsigned sheets = label_is_below ? polygon.sheets_below : polygon.sheets_above;
        std::array<VertexId, 4> id;
        for (std::size_t k = 0; k < 4; ++k) id[k] = number(polygon.corner[k], sheets >> (2 * k) & 3);
        if (polygon.extra < 0) {
            const auto length2 = [&](std::size_t a, std::size_t b) {
                return (points_[polygon.corner[a]] - points_[polygon.corner[b]]).squaredNorm();
            };
            const std::size_t from = length2(0, 2) <= length2(1, 3) ? 0 : 1;
            triangle(id[from], id[from + 1], id[from + 2], turn);
            triangle(id[from], id[from + 2], id[(from + 3) % 4], turn);
            return;
        }
        const auto& sides = net_.side_vertices[static_cast<std::size_t>(polygon.extra)];
        const VertexId middle = make(points_[centre]);
        for (std::size_t k = 0; k < 4; ++k) {
            VertexId from = id[k];
            if (sides[k] != NetPolygon::none) {
                const VertexId between = number(sides[k], 0);
                triangle(middle, from, between, turn);
                from = between;
            }
            triangle(middle, from, id[(k + 1) % 4], turn);
        }
    }

    const LabelNet& net_;
    const Array<Vec3f>& points_;
    const bool mirrored_;
    std::vector<VertexId> number_, used_;
    std::unordered_map<std::uint64_t, VertexId> further_;
    TriMesh* out_ = nullptr;
};

}  // namespace

namespace {

/// The places of the chosen labels in the list of those that occur.
std::vector<std::size_t> chosen_labels(const std::vector<float>& present,
                                       const std::vector<std::int64_t>& chosen) {
    std::vector<std::size_t> out;
    for (std::size_t k = 0; k < present.size(); ++k)
        if (present[k] != 0 && chosen.empty()) out.push_back(k);
    for (const std::int64_t label : chosen) {
        const auto at = std::find_if(present.begin(), present.end(),
                                     [&](float value) { return static_cast<std::int64_t>(value) == label; });
        if (at == present.end()) throw InvalidInput(fmt::format("no voxel has the label {}", label));
        out.push_back(static_cast<std::size_t>(at - present.begin()));
    }
    std::sort(out.begin(), out.end());
    return out;
}

/// World positions of the net's vertices, then of the middles of those polygons that have vertices in their
/// sides.
Array<Vec3f> world_points(const LabelNet& net, const Array<Vec3>& places, const Frame& frame) {
    Array<Vec3f> points(places.size() + net.polygons.size());
    parallel_for(places.size(), 4096,
                 [&](std::size_t v) { points[v] = frame.to_world(places[v].cast<double>()).cast<float>(); });
    parallel_for(net.polygons.size(), 4096, [&](std::size_t p) {
        const NetPolygon& polygon = net.polygons[p];
        Vec3d mean = Vec3d::Zero();
        for (const VertexId v : polygon.corner) mean += places[v].cast<double>() / 4;
        points[places.size() + p] = frame.to_world(mean).cast<float>();
    });
    return points;
}

}  // namespace

void LabelSurfacesOptions::check() const {
    if (iterations < 0 || iterations > 10000)
        throw InvalidInput(fmt::format("iterations are 0 to 10000, not {}", iterations));
    if (!(max_shift > 0 && max_shift <= 2))
        throw InvalidInput(
            fmt::format("the largest shift is above 0 and at most 2 voxels, not {}", max_shift));
    std::set<std::int64_t> seen;
    for (const std::int64_t label : labels)
        if (label == 0 || !seen.insert(label).second)
            throw InvalidInput(
                fmt::format("label {} {}", label, label == 0 ? "is the background" : "is asked for twice"));
}

bool is_label_map(const DensityMap& map) {
    constexpr std::size_t most_labels = 65536;
    std::set<float> seen;
    float last = 0;
    const auto is_label = [&](float value) {
        if (value == last) return true;
        last = value;
        if (!(std::trunc(value) == value) || std::abs(value) > 0x1p62f) return false;
        seen.insert(value);
        return seen.size() <= most_labels;
    };
    const openvdb::FloatTree& tree = map.grid->constTree();
    if (!is_label(tree.background())) return false;
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile)
        if (!is_label(*tile)) return false;
    std::uint64_t pairs = 0, equal = 0;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        const float* values = leaf->buffer().data();
        for (int i = 0; i < leaf::size; ++i) {
            if (!is_label(values[i])) return false;
            if (i % leaf::dim == 0 || values[i] == 0 || values[i - 1] == 0) continue;
            ++pairs;
            equal += values[i] == values[i - 1];
        }
    }
    seen.erase(0);
    return !seen.empty() && 4 * equal >= 3 * pairs;
}

std::vector<LabelSurface> label_surfaces(const DensityMap& labels, const LabelSurfacesOptions& options,
                                         const Progress& progress) {
    options.check();
    const LabelNet net = label_net(labels, options.max_shift, progress.part(0, 0.4));
    const std::vector<std::size_t> chosen = chosen_labels(net.labels, options.labels);
    const Array<Vec3f> points =
        world_points(net, smoothed(net, options.iterations, progress.part(0.4, 0.8)), labels.frame);
    std::vector<std::vector<std::uint64_t>> of_label(net.labels.size());
    const auto place = [&](float label) {
        return static_cast<std::size_t>(std::lower_bound(net.labels.begin(), net.labels.end(), label) -
                                        net.labels.begin());
    };
    for (std::uint64_t p = 0; p < net.polygons.size(); ++p)
        for (const float label : {net.polygons[p].below, net.polygons[p].above})
            if (label != 0) of_label[place(label)].push_back(p);
    LabelMesher mesher(net, points, labels.frame.axes.determinant() < 0);
    std::vector<LabelSurface> out;
    for (const std::size_t k : chosen) {
        out.push_back({static_cast<std::int64_t>(net.labels[k]), mesher.run(net.labels[k], of_label[k])});
        progress.report(0.8 + 0.2 * static_cast<double>(out.size()) / static_cast<double>(chosen.size()));
    }
    return out;
}

}  // namespace vdbgeo
