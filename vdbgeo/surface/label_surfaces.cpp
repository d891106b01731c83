#include "vdbgeo/surface/label_surfaces.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
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

Array<Vec3> smoothed(const LabelNet& net, int iterations, const Progress& progress) {
    Array<Vec3> points(net.vertices.size()), next(net.vertices.size());
    for (std::size_t v = 0; v < points.size(); ++v) points[v] = net.vertices[v].start;
    if (iterations == 0) return points;
    const Neighbours near = neighbours_of(net);
    const double pass = std::getenv("PASS") ? atof(std::getenv("PASS")) : 0.0;
    const double lambda = std::getenv("LAMBDA") ? atof(std::getenv("LAMBDA")) : 0.5;
    const double anchor = std::getenv("ANCHOR") ? atof(std::getenv("ANCHOR")) : 0.0;
    const double mu = pass > 0 ? 1 / (pass - 1 / lambda) : lambda;
    for (int k = 0; k < iterations; ++k) {
        const float factor = static_cast<float>(k % 2 ? mu : lambda);
        parallel_for(points.size(), 4096, [&](std::size_t v) {
            const NetVertex& at = net.vertices[v];
            Vec3 mean = Vec3::Zero();
            for (std::uint64_t i = near.first[v]; i < near.first[v + 1]; ++i) mean += points[near.ids[i]];
            const auto count = near.first[v + 1] - near.first[v];
            Vec3 moved = points[v];
            if (count > 0) moved += factor * (mean / static_cast<float>(count) - moved);
            moved += float(anchor) * (at.start - moved);
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

void LabelSurfacesOptions::check() const {}

bool is_label_map(const DensityMap&) { return false; }

std::vector<LabelSurface> label_surfaces(const DensityMap& labels, const LabelSurfacesOptions& options,
                                         const Progress& progress) {
    options.check();
    const LabelNet net = label_net(labels, options.max_shift, progress.part(0, 0.4));
    const Array<Vec3> places = smoothed(net, options.iterations, progress.part(0.4, 0.8));
    Array<Vec3f> points(places.size() + net.polygons.size());
    parallel_for(places.size(), 4096,
                 [&](std::size_t v) { points[v] = labels.frame.to_world(places[v].cast<double>()).cast<float>(); });
    parallel_for(net.polygons.size(), 4096, [&](std::size_t p) {
        const NetPolygon& polygon = net.polygons[p];
        if (polygon.extra < 0) return;
        Vec3d mean = Vec3d::Zero();
        for (const VertexId v : polygon.corner) mean += places[v].cast<double>() / 4;
        points[places.size() + p] = labels.frame.to_world(mean).cast<float>();
    });
    std::vector<std::vector<std::uint64_t>> of_label(net.labels.size());
    const auto place = [&](float label) {
        return static_cast<std::size_t>(std::lower_bound(net.labels.begin(), net.labels.end(), label) -
                                        net.labels.begin());
    };
    for (std::uint64_t p = 0; p < net.polygons.size(); ++p) {
        of_label[place(net.polygons[p].below)].push_back(p);
        of_label[place(net.polygons[p].above)].push_back(p);
    }
    LabelMesher mesher(net, points, labels.frame.axes.determinant() < 0);
    std::vector<LabelSurface> out;
    for (std::size_t k = 0; k < net.labels.size(); ++k)
        if (net.labels[k] != 0)
            out.push_back({static_cast<std::int64_t>(net.labels[k]), mesher.run(net.labels[k], of_label[k])});
    return out;
}

}  // namespace vdbgeo
