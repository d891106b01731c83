#include "vdbgeo/measure/pocket_depth.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <optional>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/convex_hull.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/triangle_tree.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;
constexpr std::size_t grain = 256;

/// The shell that each vertex belongs to, as a component's number.
Array<std::uint32_t> shell_of_vertices(const TriMesh& mesh, const Progress& progress) {
    const MeshComponents pieces = mesh_components(mesh, progress);
    const auto shells = shells_of_cavities(mesh, pieces);
    Array<std::uint32_t> of;
    of.assign(mesh.points.size(), none);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const std::uint32_t piece = pieces.of_face[f];
        for (const VertexId v : mesh.triangles[f]) of[v] = shells[piece].value_or(piece);
    }
    return of;
}

/// Numbers of elements put together by a key, each group in rising order.
struct Groups {
    std::vector<std::uint64_t> end;
    std::vector<std::uint32_t> members;

    template <class Key>
    Groups(std::size_t elements, std::size_t keys, const Key& key) : end(keys + 1, 0) {
        for (std::size_t i = 0; i < elements; ++i)
            if (key(i) < keys) ++end[key(i) + 1];
        for (std::size_t k = 0; k < keys; ++k) end[k + 1] += end[k];
        members.resize(end.back());
        std::vector<std::uint64_t> next(end.begin(), end.end() - 1);
        for (std::size_t i = 0; i < elements; ++i)
            if (key(i) < keys) members[next[key(i)]++] = static_cast<std::uint32_t>(i);
    }
};

/// Bits of the 8³ places of a block.
using Places = std::bitset<512>;

/// The centres of a ball that rolls on a mesh from outside, on a cubic grid in blocks of 8³ places. Frames
/// are relative to `low`, the first place.
class BallCentres {
 public:
    BallCentres(const TriMesh& mesh, const TriangleTree& tree, double radius)
        : tree_(tree), radius_(radius), spacing_(ambient_spacing * radius) {
        Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (const Triangle& t : mesh.triangles)
            for (const VertexId v : t) {
                low = low.cwiseMin(mesh.points[v].cast<double>());
                high = high.cwiseMax(mesh.points[v].cast<double>());
            }
        low_ = low - Vec3d::Constant(radius + 9 * spacing_);
        const Vec3d blocks = ((high - low_).array() + radius) / (8 * spacing_) + 2;
        if (!(blocks.prod() < 1 << 24))
            throw InvalidInput(
                fmt::format("pockets: a ball of {:.6g} Å is too small to roll on a mesh of {:.6g} Å; try "
                            "{:.3g} Å or more",
                            radius, (high - low).maxCoeff(), radius * std::cbrt(blocks.prod() / (1 << 23))));
        size_ = blocks.cast<int>();
    }

    void find(const Progress& progress) {
        classify(progress.part(0, 0.8));
        flood();
        progress.report(0.9);
    }
    /// Those where the ball touches the mesh, next to each grid place at the boundary; relative to low().
    Array<Vec3f> touching() const;
    const Vec3d& low() const { return low_; }

 private:
    enum State : std::uint8_t { closed, open, mixed };
    struct Block {
        Places open, reached;
    };
    static std::uint64_t code(std::uint64_t block, std::uint64_t place) { return block << 9 | place; }

    std::uint64_t block_count() const {
        return std::uint64_t(size_.x()) * std::uint64_t(size_.y()) * std::uint64_t(size_.z());
    }
    Vec3i block_at(std::uint64_t b) const {
        const auto x = std::uint64_t(size_.x()), y = std::uint64_t(size_.y());
        return {int(b % x), int(b / x % y), int(b / (x * y))};
    }
    std::uint64_t number(const Vec3i& at) const {
        return (std::uint64_t(at.z()) * std::uint64_t(size_.y()) + std::uint64_t(at.y())) *
                   std::uint64_t(size_.x()) +
               std::uint64_t(at.x());
    }
    Vec3d position(std::uint64_t place_code) const {
        const auto p = int(place_code & 511);
        return spacing_ * (8 * block_at(place_code >> 9) + Vec3i(p & 7, p >> 3 & 7, p >> 6)).cast<double>();
    }
    /// Whether the distance of places around `centre`, up to `reach` from it, is surely one side of radius.
    State state(const Vec3d& centre, double reach) const {
        const double far = radius_ + reach;
        const double d2 = tree_.nearest(low_ + centre, far * far).squared_distance;
        if (!std::isfinite(d2)) return open;
        return d2 < std::pow(std::max(0.0, radius_ - reach), 2) ? closed : mixed;
    }

    void classify(const Progress& progress);
    void fill(std::uint64_t b, Block& block) const;
    void flood();
    void reach(std::uint64_t b, std::uint64_t place, std::vector<std::uint64_t>& front);
    template <class Visit>
    void for_each_neighbour(std::uint64_t place_code, const Visit& visit) const;
    bool is_open(std::uint64_t c) const {
        const State s = State(state_[c >> 9]);
        return s == mixed ? mixed_[place_[c >> 9]].open[c & 511] : s == open;
    }
    bool is_reached(std::uint64_t c) const {
        const State s = State(state_[c >> 9]);
        return s == mixed ? mixed_[place_[c >> 9]].reached[c & 511] : s == open && whole_[c >> 9];
    }

    const TriangleTree& tree_;
    double radius_, spacing_;
    Vec3d low_;
    Vec3i size_;
    std::vector<std::uint8_t> state_;    // of each block
    std::vector<std::uint8_t> whole_;    // whether an open block is reached
    std::vector<std::uint32_t> place_;   // of a mixed block in mixed_
    std::vector<std::uint32_t> blocks_;  // the mixed ones
    std::vector<Block> mixed_;
};

/// The six places around one, over the blocks' sides; none outside of the grid.
template <class Visit>
void BallCentres::for_each_neighbour(std::uint64_t c, const Visit& visit) const {
    for (int axis = 0; axis < 3; ++axis)
        for (const int way : {-1, 1}) {
            const int at = int(c >> 3 * axis & 7) + way;
            if (at >= 0 && at < 8) {
                visit(way < 0 ? c - (1ull << 3 * axis) : c + (1ull << 3 * axis));
                continue;
            }
            Vec3i block = block_at(c >> 9);
            block[axis] += way;
            if (block[axis] < 0 || block[axis] >= size_[axis]) continue;
            const std::uint64_t inside = (c & 511 & ~(7ull << 3 * axis)) | std::uint64_t(at & 7) << 3 * axis;
            visit(code(number(block), inside));
        }
}

void BallCentres::classify(const Progress& progress) {
    constexpr double half_diagonal = 6.1;  // of 7 spacings
    const std::uint64_t count = block_count();
    state_.resize(count);
    whole_.assign(count, 0);
    place_.assign(count, none);
    parallel_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b)
            state_[b] = state(spacing_ * (8 * block_at(b).cast<double>() + Vec3d::Constant(3.5)),
                              half_diagonal * spacing_);
        progress.report(0.2 * double(end) / double(count));
    });
    for (std::size_t b = 0; b < count; ++b)
        if (state_[b] == mixed) {
            place_[b] = static_cast<std::uint32_t>(blocks_.size());
            blocks_.push_back(static_cast<std::uint32_t>(b));
        }
    mixed_.resize(blocks_.size());
    parallel_blocks(blocks_.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) fill(blocks_[i], mixed_[i]);
        progress.report(0.2 + 0.8 * double(end) / double(blocks_.size()));
    });
}

void BallCentres::fill(std::uint64_t b, Block& block) const {
    constexpr double half_diagonal = 2.7;  // of 3 spacings
    for (std::uint64_t part = 0; part < 8; ++part) {
        const std::uint64_t first = (part & 1) << 2 | (part >> 1 & 1) << 5 | (part >> 2) << 8;
        const Vec3d corner = position(code(b, first));
        const State all = state(corner + Vec3d::Constant(1.5 * spacing_), half_diagonal * spacing_);
        if (all == closed) continue;
        for (std::uint64_t i = 0; i < 64; ++i) {
            const std::uint64_t p = first + ((i & 3) | (i >> 2 & 3) << 3 | (i >> 4) << 6);
            block.open[p] = all == open ||
                            !(tree_.nearest(low_ + position(code(b, p)), radius_ * radius_).squared_distance <
                              radius_ * radius_);
        }
    }
}

/// Takes a place, or with it the whole of an open block, into what is reached.
void BallCentres::reach(std::uint64_t b, std::uint64_t place, std::vector<std::uint64_t>& front) {
    if (state_[b] == open) {
        if (whole_[b]) return;
        whole_[b] = 1;
        front.push_back(code(b, 0));
    } else if (state_[b] == mixed) {
        Block& block = mixed_[place_[b]];
        if (!block.open[place] || block.reached[place]) return;
        block.reached[place] = true;
        front.push_back(code(b, place));
    }
}

/// From the first block, which no mesh is near.
void BallCentres::flood() {
    std::vector<std::uint64_t> front;
    const auto step = [&](std::uint64_t c) { reach(c >> 9, c & 511, front); };
    reach(0, 0, front);
    while (!front.empty()) {
        const std::uint64_t c = front.back();
        front.pop_back();
        if (state_[c >> 9] == mixed) {
            for_each_neighbour(c, step);
            continue;
        }
        for (std::uint64_t p = 0; p < 512; ++p) {
            const bool side = (p & 7) % 7 == 0 || (p >> 3 & 7) % 7 == 0 || (p >> 6) % 7 == 0;
            if (!side) continue;
            for_each_neighbour(code(c >> 9, p), [&](std::uint64_t n) {
                if (n >> 9 != c >> 9) step(n);
            });
        }
    }
}

Array<Vec3f> BallCentres::touching() const {
    std::vector<std::uint64_t> rim;
    for (const std::uint32_t b : blocks_)
        for (std::uint64_t p = 0; p < 512; ++p) {
            const std::uint64_t c = code(b, p);
            const bool here = is_reached(c);
            for_each_neighbour(c, [&](std::uint64_t n) {
                if (here && !is_open(n)) rim.push_back(c);
                if (!is_open(c) && state_[n >> 9] == open && is_reached(n)) rim.push_back(n);
            });
        }
    std::sort(rim.begin(), rim.end());
    rim.erase(std::unique(rim.begin(), rim.end()), rim.end());
    Array<Vec3f> places(rim.size());
    parallel_for(rim.size(), grain, [&](std::size_t i) {
        // The face nearest to a centre stays so as the ball moves straight to it.
        const Vec3d p = position(rim[i]);
        const auto touched = tree_.nearest(low_ + p);
        const double d = std::sqrt(touched.squared_distance);
        const Vec3d q = touched.point - low_;
        places[i] = (q + radius_ / d * (p - q)).cast<float>();
    });
    return places;
}

/// The diagonal of the box around all points, Å.
double extent(const TriMesh& mesh) {
    Eigen::AlignedBox3d box;
    for (const Vec3f& p : mesh.points) box.extend(p.cast<double>());
    return box.isEmpty() ? 0 : box.diagonal().norm();
}

constexpr double largest_ball = 1e4;  // extents

}  // namespace

std::vector<double> hull_depths(const TriMesh& mesh, const std::vector<VertexId>& vertices,
                                const Progress& progress) {
    std::vector<double> depths(vertices.size(), 0);
    if (vertices.empty()) return depths;
    const Array<std::uint32_t> shell = shell_of_vertices(mesh, progress.part(0, 0.3));
    std::uint32_t shells = 0;
    for (const std::uint32_t s : shell)
        if (s != none) shells = std::max(shells, s + 1);
    const Groups asked(vertices.size(), shells, [&](std::size_t i) { return shell[vertices[i]]; });
    const auto wanted = [&](std::uint32_t s) { return s != none && asked.end[s] != asked.end[s + 1]; };
    const Groups all(mesh.points.size(), shells,
                     [&](std::size_t v) { return wanted(shell[v]) ? shell[v] : none; });
    for (std::uint32_t s = 0; s < shells; ++s) {
        if (!wanted(s)) continue;
        Array<Vec3f> points;
        for (std::uint64_t i = all.end[s]; i < all.end[s + 1]; ++i)
            points.push_back(mesh.points[all.members[i]]);
        TriMesh hull;
        try {
            hull = convex_hull(points);
        } catch (const InvalidInput&) {
            if (!have_convex_hull()) throw;
            continue;  // all in one plane
        }
        const TriangleTree tree(hull);
        parallel_for(asked.end[s + 1] - asked.end[s], grain, [&](std::size_t i) {
            const std::uint32_t a = asked.members[asked.end[s] + i];
            depths[a] = std::sqrt(tree.nearest(mesh.points[vertices[a]].cast<double>()).squared_distance);
        });
        progress.report(0.3 + 0.7 * (s + 1.0) / shells);
    }
    return depths;
}

std::vector<double> ambient_depths(const TriMesh& mesh, const std::vector<VertexId>& vertices, double radius,
                                   const Progress& progress) {
    if (!(radius > 0) || !std::isfinite(radius))
        throw InvalidInput(fmt::format("pockets: a ball of radius {} Å cannot roll", radius));
    std::vector<double> depths(vertices.size(), 0);
    if (vertices.empty()) return depths;
    // Places of the ball are 32-bit floats; and so large a ball rolls on the hull.
    const double size = extent(mesh);
    if (radius > largest_ball * size)
        throw InvalidInput(fmt::format(
            "pockets: a ball of radius {:.6g} Å is too large for a mesh of {:.6g} Å; give none for "
            "the depth below the convex hull",
            radius, size));
    const TriangleTree tree(mesh);
    BallCentres centres(mesh, tree, radius);
    centres.find(progress.part(0, 0.7));
    TriMesh places;  // points as faces without an area
    places.points = centres.touching();
    for (VertexId i = 0; i < places.points.size(); ++i) places.triangles.push_back({i, i, i});
    const TriangleTree balls(places);
    progress.report(0.8);
    parallel_for(vertices.size(), grain, [&](std::size_t i) {
        const Vec3d p = mesh.points[vertices[i]].cast<double>() - centres.low();
        depths[i] = std::max(0.0, std::sqrt(balls.nearest(p).squared_distance) - radius);
    });
    progress.report(1);
    return depths;
}

}  // namespace vdbgeo
