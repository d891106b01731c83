#include "apps/surface_in_blocks.h"

#include <fmt/format.h>
#include <openvdb/tools/ValueTransformer.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "apps/stages.h"
#include "apps/surface_flags.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo::app {
namespace {

/// What the program and the strips of a file take, and what the allocator does not give back.
double reserve(const MapReadOptions& options) {
    return (52 << 20) + static_cast<double>(options.memory_limit()) / 8;
}

double gigabytes(double bytes) { return bytes / static_cast<double>(1 << 30); }

}  // namespace

void turn_over(DensityMap& map) {
    openvdb::tools::foreach (map.grid->beginValueAll(),
                             [](const openvdb::FloatGrid::ValueAllIter& it) { it.setValue(-*it); });
    map.grid->tree().root().setBackground(-map.grid->background(), false);
    map.grid->setGridClass(openvdb::GRID_UNKNOWN);
    std::swap(map.statistics.min, map.statistics.max);
    map.statistics.min *= -1;
    map.statistics.max *= -1;
    map.statistics.mean *= -1;
}

void need_surface(const std::string& name, std::uint64_t faces, double isovalue, const Statistics& of_map) {
    if (faces > 0) return;
    throw NumericalError(
        fmt::format("{}: no surface at the isovalue {:.6g}: the map's values lie between {:.6g} and "
                    "{:.6g}; try another --iso",
                    name, isovalue, of_map.min, of_map.max));
}

void put_piece(const SurfacePiece& piece, PlyPieces& file) {
    const Vec3f* points = piece.points.data();
    for (const SurfaceRun& run : piece.point_runs) {
        file.put_points(run.first, points, run.count);
        points += run.count;
    }
    const Triangle* triangles = piece.triangles.data();
    for (const SurfaceRun& run : piece.triangle_runs) {
        file.put_triangles(run.first, triangles, run.count);
        triangles += run.count;
    }
}

SurfaceInBlocks::SurfaceInBlocks(const std::string& in, const MapReadOptions& options, const Isovalue& rule,
                                 Session& session)
    : in_(in), options_(options) {
    map_ = std::make_unique<MapBlocks>(in, options, session.stage("opening"));
    for (const std::string& w : map_->whole().warnings) session.warn(in + ": " + w);
    if (!session.json && !session.quiet)
        for (const std::string& note : map_->whole().notes) session.say(in + ": " + note);
    if (!rule.needs_samples()) {
        count(rule, session);
    } else if (bytes_as_whole() > static_cast<double>(options.memory_limit())) {
        throw UsageError(fmt::format(
            "--iso {}: needs all samples at a time, about {:.1f} GB; a map that does not fit into --memory "
            "takes a density, a number of sigmas, record:FILE or auto",
            rule.text(), gigabytes(bytes_as_whole())));
    }
}

/// Blocks that fit beside what is held all the time.
BlockLattice SurfaceInBlocks::lattice() const {
    BlockRules rules;
    rules.order = map_->order();
    const openvdb::CoordBBox& box = map_->box();
    std::array<double, 3> across{};  // in blocks of 8³
    for (int a = 0; a < 3; ++a)
        across[static_cast<std::size_t>(a)] =
            box.empty() ? 0 : (static_cast<double>(box.max()[a]) - box.min()[a] + 1) / leaf::dim + 1;
    const auto [x, y, z] = across;
    // Columns that noise would cross, the lower faces of blocks, and the strips that threads work in.
    const double columns = 64 * x * y * (z / 16 + 1), faces = sizeof(BorderBlock) * (x * y + y * z + z * x),
                 strips = 2 * sizeof(float) * leaf::size * across[static_cast<std::size_t>(rules.order[0])] *
                          tbb::this_task_arena::max_concurrency();
    const double held = columns + faces + strips + static_cast<double>(map_->memory());
    const double left = static_cast<double>(options_.memory_limit()) - reserve(options_) - held;
    return naming(in_, [&] {
        return BlockLattice::of_volume(box, std::max(left, 0.0) / BlockMarchingCubes::bytes_a_voxel, rules);
    });
}

void SurfaceInBlocks::count(const Isovalue& rule, Session& session) {
    const MapFile& whole = map_->whole();
    const bool level_set = whole.level_set;
    const ReadBox read = [this, level_set](const openvdb::CoordBBox& wanted, const Progress& progress) {
        DensityMap part = map_->read(wanted, progress);
        if (level_set) turn_over(part);
        return part;
    };
    const BlockLattice blocks = lattice();
    blocks_ = blocks.size();
    naming(in_, [&] {
        isovalue_ = rule.resolve(whole.map.statistics, whole.map.grid->getGridClass());
        surface_ = std::make_unique<BlockMarchingCubes>(
            read, blocks, MarchingCubesOptions{level_set ? -isovalue_ : isovalue_},
            session.stage("counting"));
    });
}

double SurfaceInBlocks::bytes_as_whole(const WholeNeed& need) const {
    double leaves = 0;
    if (surface_) {
        leaves = static_cast<double>(surface_->leaves());
    } else if (!map_->box().empty()) {
        leaves = static_cast<double>(map_->box().volume()) / leaf::size;
    }
    return reserve(options_) + need.a_leaf * leaves + need.a_triangle * static_cast<double>(triangles()) +
           static_cast<double>(map_->memory());
}

MapFile SurfaceInBlocks::whole(Session& session) {
    surface_.reset();
    MapFile all = map_->whole();
    all.map = map_->read(openvdb::CoordBBox::inf(), session.stage("reading"));
    return all;
}

void SurfaceInBlocks::write(const std::string& out, Session& session) {
    need_surface(in_, triangles(), isovalue_, map_->statistics());
    const Progress progress = session.stage("writing");
    AtomicFile file(out);
    PlyPieces pieces(file, vertices(), triangles());
    pieces.put_header();
    const std::size_t bytes =
        std::clamp<std::size_t>(options_.memory_limit() / 64, std::size_t{1} << 20, std::size_t{32} << 20);
    surface_->fill(
        bytes, [&](const SurfacePiece& piece) { put_piece(piece, pieces); }, progress);
    file.commit();
    session.end_stage();
}

}  // namespace vdbgeo::app
