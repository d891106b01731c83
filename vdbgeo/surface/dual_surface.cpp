#include "vdbgeo/surface/dual_surface.h"

#include <fmt/format.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/split_non_manifold.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatTree;

/// Quads of OpenVDB run clockwise seen from the empty side where the class of the grid is unknown.
constexpr bool dual_runs_inward = true;

CoordBBox box_of(const Frame& frame) {
    if (!frame.bounded()) return CoordBBox::inf();
    return {Coord(0), Coord(frame.size.x() - 1, frame.size.y() - 1, frame.size.z() - 1)};
}

/// The tree that OpenVDB may read as it is, else a copy in which the outside of the box is empty and every
/// sample a finite number.
class DualField {
 public:
    DualField(const DensityMap& map, float isovalue)
        : old_(map.grid->constTree()), box_(box_of(map.frame)), isovalue_(isovalue) {
        const bool dense_outside = map.frame.bounded() && !(old_.background() < isovalue);
        CoordBBox active;
        const bool sticks_out = old_.evalActiveVoxelBoundingBox(active) && !box_.isInside(active);
        if (!dense_outside && !sticks_out && map.statistics.non_finite == 0) {
            grid_ = openvdb::FloatGrid::create(map.grid->treePtr());
            return;
        }
        find_range();
        copy(map.frame.bounded());
    }

    const openvdb::FloatGrid& grid() const { return *grid_; }

 private:
    /// How far finite samples lie from the isovalue: what is as empty as the densest sample is dense.
    void find_range() {
        for (auto leaf = old_.cbeginLeaf(); leaf; ++leaf)
            for (int i = 0; i < leaf::size; ++i) {
                const float value = leaf->buffer().data()[i];
                if (std::isfinite(value)) range_ = std::max(range_, std::abs(value - isovalue_));
            }
        if (std::isfinite(old_.background()))
            range_ = std::max(range_, std::abs(old_.background() - isovalue_));
        if (!(range_ > 0)) range_ = std::max(1e-3f * std::abs(isovalue_), 1e-30f);
        range_ = std::min(range_, std::numeric_limits<float>::max() / 4);
    }

    float finite(float value) const {
        if (std::isfinite(value)) return value;
        return value > 0 ? isovalue_ + range_ : isovalue_ - range_;  // not a number: empty
    }

    void copy(bool bounded) {
        const float empty = isovalue_ - range_, background = finite(old_.background());
        grid_ = openvdb::FloatGrid::create(bounded ? empty : background);
        FloatTree& tree = grid_->tree();
        if (bounded && background != empty) tree.sparseFill(box_, background, /*active=*/true);
        auto tile = old_.cbeginValueAll();
        tile.setMaxDepth(FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            CoordBBox at;
            tile.getBoundingBox(at);
            at.intersect(box_);
            if (!at.empty() && finite(*tile) != background)
                tree.sparseFill(at, finite(*tile), /*active=*/true);
        }
        for (auto leaf = old_.cbeginLeaf(); leaf; ++leaf) {
            if (!box_.hasOverlap(leaf->getNodeBoundingBox())) continue;
            leaf::Leaf* to = tree.touchLeaf(leaf->origin());
            for (openvdb::Index i = 0; i < leaf::size; ++i)
                if (box_.isInside(leaf->offsetToGlobalCoord(i)))
                    to->setValueOn(i, finite(leaf->buffer().data()[i]));
        }
    }

    const FloatTree& old_;
    const CoordBBox box_;
    const float isovalue_;
    float range_ = 0;
    openvdb::FloatGrid::Ptr grid_;
};

/// 2 · area / longest side²: 0 for a triangle without area, 0.87 for an equilateral one.
double shape(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    return longest2 > 0 ? static_cast<double>((b - a).cross(c - a).norm()) / longest2 : 0;
}

void add_quad(TriMesh& mesh, const std::array<VertexId, 4>& q) {
    const auto worst = [&](std::size_t from) {
        const auto at = [&](std::size_t k) { return mesh.points[q[(from + k) % 4]]; };
        return std::min(shape(at(0), at(1), at(2)), shape(at(0), at(2), at(3)));
    };
    const std::size_t from = worst(0) >= worst(1) ? 0 : 1;
    mesh.triangles.push_back({q[from], q[from + 1], q[from + 2]});
    mesh.triangles.push_back({q[from], q[from + 2], q[(from + 3) % 4]});
}

TriMesh triangles_of(openvdb::tools::VolumeToMesh& dual, const Frame& frame) {
    TriMesh mesh;
    std::uint64_t triangles = 0;
    for (std::size_t k = 0; k < dual.polygonPoolListSize(); ++k)
        triangles += 2 * dual.polygonPoolList()[k].numQuads() + dual.polygonPoolList()[k].numTriangles();
    if (std::max<std::uint64_t>(dual.pointListSize(), triangles) > TriMesh::max_vertices)
        throw InvalidInput(fmt::format("the surface has {} triangles, more than 2^32-1", triangles));
    mesh.points.resize(dual.pointListSize());
    mesh.triangles.reserve(triangles);
    parallel_for(mesh.points.size(), 4096, [&](std::size_t v) {
        const openvdb::Vec3s& p = dual.pointList()[v];
        mesh.points[v] = frame.to_world(Vec3d(p.x(), p.y(), p.z())).cast<float>();
    });
    const bool turn = dual_runs_inward != (frame.axes.determinant() < 0);
    for (std::size_t k = 0; k < dual.polygonPoolListSize(); ++k) {
        const openvdb::tools::PolygonPool& pool = dual.polygonPoolList()[k];
        for (std::size_t i = 0; i < pool.numQuads(); ++i) {
            const openvdb::Vec4I& q = pool.quad(i);
            add_quad(mesh, turn ? std::array<VertexId, 4>{q[3], q[2], q[1], q[0]}
                                : std::array<VertexId, 4>{q[0], q[1], q[2], q[3]});
        }
        for (std::size_t i = 0; i < pool.numTriangles(); ++i) {
            const openvdb::Vec3I& t = pool.triangle(i);
            mesh.triangles.push_back(turn ? Triangle{t[2], t[1], t[0]} : Triangle{t[0], t[1], t[2]});
        }
    }
    return mesh;
}

/// Takes away pairs of triangles that lie on each other back to back.
void cancel_pairs(TriMesh& mesh) {
    // Triangles by their lowest vertex, which they begin with.
    std::vector<std::uint64_t> first(mesh.points.size() + 1, 0);
    for (Triangle& t : mesh.triangles) {
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        ++first[t[0] + 1];
    }
    for (std::size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1];
    std::vector<std::uint64_t> next(first.begin(), first.end() - 1);
    std::vector<VertexId> at(mesh.triangles.size());
    for (std::size_t t = 0; t < at.size(); ++t) at[next[mesh.triangles[t][0]]++] = static_cast<VertexId>(t);
    std::vector<bool> gone(at.size(), false);
    for (std::size_t v = 0; v + 1 < first.size(); ++v)
        for (std::uint64_t i = first[v]; i < first[v + 1]; ++i)
            for (std::uint64_t j = i + 1; j < first[v + 1] && !gone[at[i]]; ++j) {
                const Triangle &a = mesh.triangles[at[i]], &b = mesh.triangles[at[j]];
                if (!gone[at[j]] && a[1] == b[2] && a[2] == b[1]) gone[at[i]] = gone[at[j]] = true;
            }
    std::size_t kept = 0;
    for (std::size_t t = 0; t < gone.size(); ++t)
        if (!gone[t]) mesh.triangles[kept++] = mesh.triangles[t];
    mesh.triangles.resize(kept);
}

/// Draws the ends of sides without length together and takes away what has no area then: triangles that name
/// a vertex twice, and pairs that lie on each other back to back. None of that opens the surface.
void collapse(TriMesh& mesh) {
    std::vector<VertexId> to(mesh.points.size());
    for (std::size_t v = 0; v < to.size(); ++v) to[v] = static_cast<VertexId>(v);
    const auto root = [&](VertexId v) {
        while (to[v] != v) v = to[v] = to[to[v]];
        return v;
    };
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const VertexId a = t[k], b = t[(k + 1) % 3];
            if (mesh.points[a] != mesh.points[b]) continue;
            const VertexId from = root(a), into = root(b);
            to[std::max(from, into)] = std::min(from, into);
        }
    std::size_t kept = 0;
    for (Triangle t : mesh.triangles) {
        for (VertexId& v : t) v = root(v);
        if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh.triangles[kept++] = t;
    }
    mesh.triangles.resize(kept);
    cancel_pairs(mesh);
}

void drop_unused(TriMesh& mesh) {
    std::vector<VertexId> number(mesh.points.size(), 0);
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t) number[v] = 1;
    VertexId next = 0;
    for (std::size_t v = 0; v < number.size(); ++v) {
        if (number[v] == 0) continue;
        mesh.points[next] = mesh.points[v];
        number[v] = next++;
    }
    mesh.points.resize(next);
    for (Triangle& t : mesh.triangles)
        for (VertexId& v : t) v = number[v];
}

}  // namespace

void DualSurfaceOptions::check() const {
    if (!std::isfinite(static_cast<float>(isovalue)))
        throw InvalidInput("the isovalue is not a finite number");
    if (!(adaptivity >= 0 && adaptivity <= 1))
        throw InvalidInput(fmt::format("the adaptivity is between 0 and 1, not {}", adaptivity));
}

TriMesh dual_surface(const DensityMap& map, const DualSurfaceOptions& options, const Progress& progress) {
    options.check();
    const DualField field(map, static_cast<float>(options.isovalue));
    progress.report(0.1);
    openvdb::tools::VolumeToMesh dual(static_cast<float>(options.isovalue), options.adaptivity);
    if (options.mask)  // in the map's indices, whatever the two transforms say
        dual.setSurfaceMask(
            options.mask->copyReplacingTransform(openvdb::math::Transform::createLinearTransform()));
    dual(field.grid());
    progress.report(0.6);
    TriMesh mesh = triangles_of(dual, map.frame);
    collapse(mesh);
    drop_unused(mesh);
    progress.report(0.8);
    split_non_manifold(mesh);
    progress.report(1);
    return mesh;
}

}  // namespace vdbgeo
