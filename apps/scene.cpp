#include "apps/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "apps/stages.h"
#include "converters/nanovdb_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/level_set.h"
#include "vdbgeo/volume/derivatives.h"
#include "vdbgeo/volume/resample.h"

namespace vdbgeo::app {
namespace {

using openvdb::GridBase;

const std::vector<std::string> known_grids{"density", "surface", "gradient", "mean_curvature"};

std::vector<std::string> split(const std::string& text, char at) {
    std::vector<std::string> parts;
    for (std::size_t begin = 0;;) {
        const std::size_t end = text.find(at, begin);
        parts.push_back(text.substr(begin, end == std::string::npos ? end : end - begin));
        if (end == std::string::npos) return parts;
        begin = end + 1;
    }
}

FogOptions parse_fog(const std::string& text) {
    const auto ends = split(text, ':');
    if (ends.size() != 2)
        throw UsageError(
            fmt::format("--fog: '{}' is not LOW:HIGH, two densities of which one may be left out", text));
    FogOptions options;
    try {
        if (!ends[0].empty()) options.low = Isovalue::parse(ends[0]);
        if (!ends[1].empty()) options.high = Isovalue::parse(ends[1]);
        options.check();
    } catch (const InvalidInput& e) {
        throw UsageError(fmt::format("--fog: {}", e.what()));
    }
    return options;
}

std::vector<std::string> parse_grids(const std::string& text) {
    std::vector<std::string> names;
    for (const std::string& name : split(text, ',')) {
        if (std::find(known_grids.begin(), known_grids.end(), name) == known_grids.end())
            throw UsageError(
                fmt::format("--grids: '{}' is none of density, surface, gradient, mean_curvature", name));
        if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
    return names;
}

std::pair<std::string, std::string> parse_addition(const std::string& text) {
    const std::size_t sign = text.find('=');
    if (sign == std::string::npos || sign == 0 || sign + 1 == text.size())
        throw UsageError(fmt::format("--add: '{}' is not NAME=FILE", text));
    return {text.substr(0, sign), text.substr(sign + 1)};
}

bool is_level_set(const MapFile& in) { return in.map.grid->getGridClass() == openvdb::GRID_LEVEL_SET; }

FogRange range_of_fog(const MapFile& in, const SceneFlags& flags) {
    const bool fog_already = in.map.grid->getGridClass() == openvdb::GRID_FOG_VOLUME;
    if (fog_already && !flags.fog_options) return {0, std::max(in.map.statistics.max, 1e-30)};
    return fog_range(in.map.statistics, flags.fog_options.value_or(FogOptions{}));
}

/// The voxels that a scene shows: those of its fog and of the band of its surface. What colours them is not
/// needed elsewhere. Unset where there is neither, or where the surface has voxels of its own.
openvdb::BoolGrid::Ptr shown_voxels(const MapFile& in, const SceneFlags& flags,
                                    const std::vector<GridBase::Ptr>& grids) {
    if (!flags.placement) return {};
    openvdb::BoolGrid::Ptr shown;
    for (const auto& grid : grids) {
        const auto floats = openvdb::gridPtrCast<openvdb::FloatGrid>(grid);
        if (!(floats->transform() == in.map.grid->transform())) return {};
        if (!shown) shown = openvdb::BoolGrid::create();
        shown->tree().topologyUnion(floats->tree());
    }
    return shown;
}

/// The density: fog for a program or on demand, else the map as it is.
GridBase::Ptr density_grid(const MapFile& in, const SceneFlags& flags, SceneLevels& levels,
                           const Progress& progress) {
    if (!flags.placement && !flags.fog_options) {
        if (in.map.grid->getName().empty()) in.map.grid->setName("density");
        return in.map.grid;
    }
    if (is_level_set(in))
        throw InvalidInput("a level set has no density to make fog of; try --grids surface");
    if (!levels.fog) levels.fog = range_of_fog(in, flags);
    const auto fog = fog_volume(in.map, *levels.fog, progress);
    if (fog->activeVoxelCount() == 0)
        throw NumericalError(fmt::format(
            "nothing lies above the fog's lower level {:.6g}: the map's values lie between {:.6g} "
            "and {:.6g}; try another --fog",
            levels.fog->low, in.map.statistics.min, in.map.statistics.max));
    return fog;
}

GridBase::Ptr added_grid(const std::string& file, const MapFile& in, const std::string& name,
                         const std::string& added, const openvdb::BoolGrid::Ptr& shown, Session& session) {
    const MapFile other = read_map(added, {}, session.stage("reading " + name));
    for (const std::string& w : other.warnings) session.warn(added + ": " + w);
    const SampledMap sampled =
        naming(added, [&] { return sample_on(other.map, in.map, name, {shown}, session.stage(name)); });
    if (sampled.frames_differ)
        session.warn(
            fmt::format("{}: its place or voxel size ({:.6g} Å) is not that of {} ({:.6g} Å), but both boxes "
                        "have the same "
                        "size: taken sample for sample",
                        added, other.map.frame.voxel_size().x(), file, in.map.frame.voxel_size().x()));
    if (sampled.outside > 0)
        session.warn(fmt::format("{}: {} voxels of {} lie outside its box and read as its background", added,
                                 sampled.outside, file));
    return sampled.grid;
}

std::vector<std::string> default_grids(const MapFile& in, const SceneFlags& flags) {
    std::vector<std::string> names = flags.grids;
    const bool raw = !flags.placement && std::find(names.begin(), names.end(), "density") == names.end();
    if (raw && !is_level_set(in)) names.insert(names.begin(), "density");
    if (names.empty()) names.push_back(is_level_set(in) ? "surface" : "density");
    return names;
}

}  // namespace

void SceneFlags::add(CLI::App& app) {
    app.add_option("--for", program,
                   "Make a scene for blender (z up) or houdini (y up): fog of 0 to 1, scaled to its units")
        ->check(CLI::IsMember({"blender", "houdini"}));
    app.add_option("--units-per-A", units_per_A, "Scene units per Å, with --for [0.01]");
    app.add_flag("--center", centre, "Put the middle of the map's box at the scene's origin, with --for");
    app.add_option(
        "--grids", grid_names,
        "Grids to write: of density, surface, gradient, mean_curvature, with commas between [density]");
    app.add_option(
           "--iso", iso,
           "Isovalue of the grid surface: a density, Nsigma (mean + N rms), volume:V (Å^3), mass:M (Da, kDa, "
           "MDa), otsu, or auto (3sigma)")
        ->capture_default_str();
    app.add_option(
        "--fog", fog,
        "LOW:HIGH, the densities that become 0 and 1 in fog, each a number or Nsigma [2sigma:maximum]");
    app.add_option(
           "--add", additions,
           "NAME=FILE: another map (a mask, local resolution) as a grid on the same voxels; repeatable")
        ->allow_extra_args(false);
}

void SceneFlags::finish() {
    if (!program.empty()) {
        placement.emplace();
        if (program == "houdini") placement->program = SceneProgram::houdini;
        if (units_per_A) placement->units_per_A = *units_per_A;
        try {
            placement->check();
        } catch (const InvalidInput& e) {
            throw UsageError(fmt::format("--units-per-A: {}", e.what()));
        }
    } else if (units_per_A || centre) {
        throw UsageError(
            "--units-per-A and --center place a scene: they need --for blender or --for houdini");
    }
    if (!grid_names.empty()) grids = parse_grids(grid_names);
    if (!fog.empty()) fog_options = parse_fog(fog);
    try {
        isovalue = Isovalue::parse(iso);
    } catch (const InvalidInput& e) {
        throw UsageError(fmt::format("--iso: {}", e.what()));
    }
    std::set<std::string> taken(known_grids.begin(), known_grids.end());
    for (const std::string& text : additions) {
        added.push_back(parse_addition(text));
        if (!taken.insert(added.back().first).second)
            throw UsageError(fmt::format("--add: the name '{}' is taken", added.back().first));
    }
}

std::vector<GridBase::ConstPtr> scene_grids(const std::string& file, const MapFile& in,
                                            const SceneFlags& flags, SceneLevels& levels, Session& session) {
    return naming(file, [&] {
        const auto names = default_grids(in, flags);
        const auto asked = [&](const char* name) {
            return std::find(names.begin(), names.end(), name) != names.end();
        };
        std::vector<GridBase::Ptr> grids;
        if (asked("density")) grids.push_back(density_grid(in, flags, levels, session.stage("density")));
        if (asked("surface")) {
            if (!levels.isovalue) levels.isovalue = flags.isovalue.resolve(in.map);
            grids.push_back(level_set(in.map, *levels.isovalue, {}, session.stage("surface")));
        }
        const auto shown = shown_voxels(in, flags, grids);
        if (asked("gradient")) grids.push_back(gradient(in.map, {shown}, session.stage("gradient")));
        if (asked("mean_curvature"))
            grids.push_back(mean_curvature(in.map, {shown}, session.stage("mean curvature")));
        for (const auto& [name, added] : flags.added)
            grids.push_back(added_grid(file, in, name, added, shown, session));
        if (flags.placement) {
            PlacementOptions placement = *flags.placement;
            if (!levels.centre_A)
                levels.centre_A = flags.centre ? centre_of_box(in.map) : Vec3d(Vec3d::Zero());
            placement.centre_A = *levels.centre_A;
            for (const auto& grid : grids) place(*grid, placement);
        }
        return std::vector<GridBase::ConstPtr>(grids.begin(), grids.end());
    });
}

void write_grids(const std::vector<GridBase::ConstPtr>& grids, const std::string& path,
                 const VdbWriteOptions& vdb, const Progress& progress) {
    if (is_nanovdb_ending(path))
        write_nanovdb(grids, path, progress);
    else
        write_vdb(grids, path, vdb, progress);
}

Json scene_json(const std::vector<GridBase::ConstPtr>& grids, const SceneFlags& flags,
                const SceneLevels& levels) {
    Json list = Json::array();
    for (const auto& grid : grids)
        list.push_back({{"name", grid->getName()},
                        {"class", GridBase::gridClassToString(grid->getGridClass())},
                        {"active_voxels", grid->activeVoxelCount()}});
    Json j{{"grids", list}};
    if (levels.fog) j["fog"] = {levels.fog->low, levels.fog->high};
    if (levels.isovalue) j["iso"] = *levels.isovalue;
    if (flags.placement) {
        j["for"] = name_of(flags.placement->program);
        j["units_per_A"] = flags.placement->units_per_A;
    }
    return j;
}

std::string numbered(const std::string& path, int number) {
    const std::filesystem::path whole(path);
    const std::string name =
        fmt::format("{}_{:04}{}", whole.stem().string(), number, whole.extension().string());
    return (whole.parent_path() / name).string();
}

}  // namespace vdbgeo::app
