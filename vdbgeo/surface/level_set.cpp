#include "vdbgeo/surface/level_set.h"

#include <fmt/format.h>
#include <openvdb/math/Proximity.h>
#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>
#include <openvdb/tree/NodeManager.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/mesh_solid.h"
#include "vdbgeo/volume/derived_grid.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;

/// The field whose samples at or above `level` are inside, and empty outside the map's box.
struct Field {
    FloatTree::ConstPtr tree;
    double level = 0;
};

Field dense_field(const DensityMap& map, double isovalue) {
    Field field{map.grid->constTreePtr(), isovalue};
    if (map.grid->getGridClass() == openvdb::GRID_LEVEL_SET) {
        const auto turned = std::make_shared<FloatTree>(*field.tree);
        openvdb::tree::NodeManager<FloatTree> nodes(*turned);
        nodes.foreachTopDown([](auto& node, std::size_t = 0) {
            for (auto it = node.beginValueAll(); it; ++it) it.setValue(-*it);
        });
        turned->root().setBackground(-turned->background(), /*updateChildNodes=*/false);
        field = {turned, -isovalue};
    }
    if (field.tree->background() >= static_cast<float>(field.level)) {
        // A dense background would fill the world. As far below the level as the densest sample is above it:
        // the surface then closes half a voxel outside.
        const double above = std::max(map.statistics.max - field.level, 1e-3 * std::abs(field.level) + 1e-30);
        const auto emptied = std::make_shared<FloatTree>(*field.tree);
        openvdb::tools::changeBackground(*emptied, static_cast<float>(field.level - above));
        field.tree = emptied;
    }
    return field;
}

/// Where the level set's voxels lie: on the map's, or on cubes of the smallest voxel length over the same
/// box.
struct Target {
    Frame frame;
    bool same = true;
    Eigen::Affine3d from_map = Eigen::Affine3d::Identity();  ///< index of the map → index of the level set
};

Target target_of(const DensityMap& map) {
    Target target;
    target.frame = map.frame;
    if (transform_of(map.frame)->hasUniformScale()) return target;
    target.same = false;
    const double h = map.frame.voxel_size().minCoeff();
    Vec3d low = map.frame.origin, high = low;
    for (int corner = 0; corner < 8 && map.frame.bounded(); ++corner) {
        const Vec3d at(corner & 1, corner >> 1 & 1, corner >> 2);
        const Vec3d p =
            map.frame.to_world(at.cwiseProduct((map.frame.size.array() - 1).matrix().cast<double>()));
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    target.frame.axes = h * Mat3d::Identity();
    target.frame.origin = low;
    if (map.frame.bounded())
        target.frame.size = ((high - low) / h).array().ceil().cast<int>().matrix() + Vec3i::Ones();
    target.from_map.linear() = map.frame.axes / h;
    target.from_map.translation() = (map.frame.origin - low) / h;
    return target;
}

/// The triangles in the indices of the level set, found by the unit cell that holds their middle.
class TriangleCells {
 public:
    TriangleCells(const TriMesh& mesh, const Target& target) : mesh_(mesh), target_(target), heads_(none) {
        next_.resize(mesh.triangles.size());
        openvdb::tree::ValueAccessor<openvdb::Int64Tree> heads(heads_);
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            const auto corners = triangle(t);
            const openvdb::Vec3d middle = (corners[0] + corners[1] + corners[2]) / 3;
            const Coord cell = Coord::floor(middle);
            for (const auto& p : corners)
                for (int a = 0; a < 3; ++a) reach_ = std::max({reach_, cell[a] - p[a], p[a] - cell[a] - 1});
            next_[t] = heads.getValue(cell);
            heads.setValue(cell, static_cast<std::int64_t>(t));
        }
    }

    static constexpr std::int64_t none = -1;
    const openvdb::Int64Tree& heads() const { return heads_; }
    /// How far a triangle sticks out of its cell, at most; 0 where cells are those of marching cubes.
    double reach() const { return reach_; }

    /// The least of `best` and the squared distances from p to the triangles of the list that begins at `t`.
    double nearest(std::int64_t t, const openvdb::Vec3d& p, double best) const {
        for (; t != none; t = next_[static_cast<std::size_t>(t)]) {
            const auto c = triangle(static_cast<std::size_t>(t));
            openvdb::Vec3d weights;
            const auto at = openvdb::math::closestPointOnTriangleToPoint(c[0], c[1], c[2], p, weights);
            best = std::min(best, (at - p).lengthSqr());
        }
        return best;
    }

 private:
    std::array<openvdb::Vec3d, 3> triangle(std::size_t t) const {
        std::array<openvdb::Vec3d, 3> corners;
        for (std::size_t c = 0; c < 3; ++c) {
            Vec3d p = mesh_.points[mesh_.triangles[t][c]].cast<double>();
            if (!target_.same) p = target_.from_map * p;
            corners[c] = openvdb::Vec3d(p.x(), p.y(), p.z());
        }
        return corners;
    }

    const TriMesh& mesh_;
    const Target& target_;
    openvdb::Int64Tree heads_;
    Array<std::int64_t> next_;
    double reach_ = 0;
};

/// Cells around a voxel, nearest first: no triangle of a cell is nearer than `bound` (squared).
struct CellOffset {
    Coord offset;
    double bound = 0;
};

std::vector<CellOffset> cells_around(double radius, double reach) {
    std::vector<CellOffset> cells;
    const int far = static_cast<int>(std::ceil(radius + reach)) + 1;
    for (int x = -far; x <= far; ++x)
        for (int y = -far; y <= far; ++y)
            for (int z = -far; z <= far; ++z) {
                double bound = 0;
                for (const int o : {x, y, z}) {
                    const double gap = std::max({0.0, o - reach, -1.0 - o - reach});
                    bound += gap * gap;
                }
                if (bound < radius * radius) cells.push_back({Coord(x, y, z), bound});
            }
    std::stable_sort(cells.begin(), cells.end(),
                     [](const CellOffset& a, const CellOffset& b) { return a.bound < b.bound; });
    return cells;
}

/// Whether the field is dense at voxels of the level set.
class Side {
 public:
    Side(const Field& field, const Target& target)
        : samples_(*field.tree),
          level_(static_cast<float>(field.level)),
          same_(target.same),
          to_map_(target.from_map.inverse()) {}

    bool operator()(const Coord& ijk) const {
        if (same_) return samples_.getValue(ijk) >= level_;
        const Vec3d p = to_map_ * Vec3d(ijk.x(), ijk.y(), ijk.z());
        return openvdb::tools::BoxSampler::sample(samples_, openvdb::Vec3d(p.x(), p.y(), p.z())) >= level_;
    }

 private:
    FloatGrid::ConstAccessor samples_;
    float level_;
    bool same_;
    Eigen::Affine3d to_map_;
};

/// The band of voxels nearer than `half` voxels to a triangle, with signed distances; all else is ±width.
/// Each voxel looks through the cells around it, the nearest first, until no cell can hold a nearer triangle:
/// exact, and about a hundred cells of which few are not empty.
/// `side_of()` gives each task a function of its own from voxel to whether it is dense.
template <class SideOf>
FloatTree::Ptr signed_band(const TriangleCells& triangles, const SideOf& side_of, double half, float width,
                           const Progress& progress) {
    openvdb::MaskTree near(triangles.heads(), false, true, openvdb::TopologyCopy());
    openvdb::tools::dilateActiveValues(near, static_cast<int>(std::ceil(half + triangles.reach())) + 1,
                                       openvdb::tools::NN_FACE_EDGE_VERTEX);
    const auto tree = std::make_shared<FloatTree>(near, width, openvdb::TopologyCopy());
    tree->voxelizeActiveTiles();
    near.clear();
    const auto around = cells_around(half, triangles.reach());
    const double voxel = width / half;
    openvdb::tree::LeafManager<FloatTree> leaves(*tree);
    std::atomic<std::size_t> done{0};
    parallel_for(leaves.leafCount(), 8, [&](std::size_t n) {
        const auto is_dense = side_of();
        openvdb::tree::ValueAccessor<const openvdb::Int64Tree> heads(triangles.heads());
        for (auto it = leaves.leaf(n).beginValueOn(); it; ++it) {
            const Coord ijk = it.getCoord();
            const openvdb::Vec3d p = ijk.asVec3d();
            double best = half * half;
            for (const CellOffset& cell : around) {
                if (cell.bound >= best) break;
                const std::int64_t first = heads.getValue(ijk + cell.offset);
                if (first != TriangleCells::none) best = triangles.nearest(first, p, best);
            }
            const bool in_band = best < half * half;
            const float distance = std::min(width, static_cast<float>(std::sqrt(best) * voxel));
            it.setValue(is_dense(ijk) ? -distance : distance);
            if (!in_band || distance >= width) it.setValueOff();
        }
        const std::size_t now = ++done;
        if (now % 64 == 0)
            progress.report(static_cast<double>(now) / static_cast<double>(leaves.leafCount()));
    });
    return tree;
}

/// The band with all else filled in by its side.
FloatGrid::Ptr level_set_grid(const FloatTree::Ptr& band) {
    openvdb::tools::pruneInactive(*band);  // the flood goes from active voxel to active voxel
    openvdb::tools::signedFloodFill(*band);
    openvdb::tools::pruneLevelSet(*band);
    const auto grid = FloatGrid::create(band);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    return grid;
}

/// The same surface in triangles of edges up to `longest`, cut into n² similar parts each: one large triangle
/// would make every voxel look far around.
TriMesh in_small_parts(const TriMesh& mesh, double longest) {
    TriMesh parts;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        const double edge = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
        const int n = std::max(1, static_cast<int>(std::ceil(edge / longest)));
        const auto first = static_cast<VertexId>(parts.points.size());
        const auto at = [&](int i, int j) { return first + static_cast<VertexId>(i * (i + 1) / 2 + j); };
        for (int i = 0; i <= n; ++i)  // row i has i + 1 points, from the side of b to that of c
            for (int j = 0; j <= i; ++j)
                parts.points.push_back((a + (b - a) * (i - j) / n + (c - a) * j / n).cast<float>());
        for (int i = 0; i < n; ++i)
            for (int j = 0; j <= i; ++j) {
                parts.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
                if (j < i) parts.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
            }
    }
    return parts;
}

/// half · voxel as a float that is not below it: OpenVDB's check of level sets divides again.
float band_width(double half, double voxel) {
    float width = static_cast<float>(half * voxel);
    while (width / voxel < half) width = std::nextafter(width, std::numeric_limits<float>::infinity());
    return width;
}

}  // namespace

void LevelSetOptions::check() const {
    if (!(half_width >= 3 && half_width <= 100))
        throw InvalidInput(
            fmt::format("half the width of a level set is {} voxels, not 3 to 100", half_width));
}

FloatGrid::Ptr level_set(const DensityMap& map, double isovalue, const LevelSetOptions& options,
                         const Progress& progress) {
    options.check();
    if (!std::isfinite(isovalue)) throw InvalidInput("the isovalue is not a finite number");
    const Field field = dense_field(map, isovalue);
    const Target target = target_of(map);
    DensityMap unbounded;  // in its own indices: no rounding far from the world's origin
    unbounded.grid = FloatGrid::create(std::const_pointer_cast<FloatTree>(field.tree));
    unbounded.statistics = map.statistics;
    const TriMesh mesh = marching_cubes(unbounded, {field.level}, progress.part(0, 0.3));
    if (mesh.empty())
        throw NumericalError(
            fmt::format("no surface at the isovalue {:.6g}: the map's values lie between {:.6g} and {:.6g}",
                        isovalue, map.statistics.min, map.statistics.max));

    const auto transform = transform_of(target.frame);
    const float width = band_width(options.half_width, transform->voxelSize()[0]);
    const auto grid = level_set_grid(signed_band(
        TriangleCells(mesh, target), [&] { return Side(field, target); }, options.half_width, width,
        progress.part(0.4, 0.95)));
    progress.report(1);

    const std::string line =
        fmt::format("level set at {} half width {} voxels", isovalue, options.half_width);
    derive_from(*map.grid, target.frame, *grid, "surface", line);
    set_metadata(*grid, "vdbgeo_isovalue", isovalue);
    return grid;
}

FloatGrid::Ptr mesh_level_set(const TriMesh& mesh, double voxel_A, const LevelSetOptions& options,
                              const Progress& progress) {
    options.check();
    check(mesh, "level set");
    if (mesh.empty()) throw InvalidInput("a level set needs a mesh that has faces");
    if (!(voxel_A > 0) || !std::isfinite(voxel_A))
        throw InvalidInput(fmt::format("a voxel of {} Å is not a length above 0", voxel_A));
    std::vector<Vec3d> points(mesh.points.size());
    double far = 0;
    for (std::size_t v = 0; v < points.size(); ++v) {
        points[v] = mesh.points[v].cast<double>();
        far = std::max(far, points[v].cwiseAbs().maxCoeff());
    }
    if (far / voxel_A > (1 << 29))
        throw InvalidInput(
            fmt::format("a voxel of {} Å is too small for a mesh that reaches {} Å", voxel_A, far));
    Target target;
    target.same = false;
    target.frame.axes = voxel_A * Mat3d::Identity();
    target.from_map.linear() = Mat3d::Identity() / voxel_A;
    const MeshSolid solid(std::move(points), mesh.triangles);
    const auto side_of = [&] {
        return [&](const Coord& ijk) { return solid(voxel_A * Vec3d(ijk.x(), ijk.y(), ijk.z())) > 0; };
    };
    const float width = band_width(options.half_width, voxel_A);
    const TriMesh parts = in_small_parts(mesh, 2 * voxel_A);
    const auto grid = level_set_grid(signed_band(TriangleCells(parts, target), side_of, options.half_width,
                                                 width, progress.part(0.1, 0.95)));
    grid->setTransform(transform_of(target.frame));
    grid->setName("surface");
    progress.report(1);
    return grid;
}

}  // namespace vdbgeo
