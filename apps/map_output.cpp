#include "apps/map_output.h"

#include <fmt/format.h>

#include <cstdlib>

#include "apps/reports.h"
#include "converters/map_copy.h"
#include "converters/vdb_sections.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

/// FACTOR[,OFFSET], whole; nothing where it is something else.
std::optional<MrcScaling> parse_scaling(const std::string& text) {
    MrcScaling scaling;
    const char* at = text.c_str();
    char* end = nullptr;
    scaling.factor = std::strtod(at, &end);
    if (end == at) return std::nullopt;
    if (*end == ',') {
        at = end + 1;
        scaling.offset = std::strtod(at, &end);
        if (end == at) return std::nullopt;
    }
    return *end == '\0' ? std::optional<MrcScaling>(scaling) : std::nullopt;
}

void set_scaling(const std::string& text, MrcWriteOptions& options) {
    using Scaling = MrcWriteOptions::Scaling;
    if (text == "none" || text == "auto") {
        options.scaling = text == "auto" ? Scaling::automatic : Scaling::none;
        return;
    }
    const auto scaling = parse_scaling(text);
    if (!scaling) throw CLI::ValidationError("--scale", text + " is neither none, auto nor FACTOR[,OFFSET]");
    options.scaling = Scaling::given;
    options.given = *scaling;
}

/// As grid_json; the statistics are those of the numbers in the map file.
Json unloaded_grid_json(const VdbSections& source, const Statistics& written) {
    DensityMap map;
    map.grid = std::const_pointer_cast<openvdb::FloatGrid>(source.grid().copy());
    map.frame = source.frame();
    map.statistics = written;
    Json j = grid_json(map);
    const openvdb::CoordBBox& box = source.active_box();
    j["active_voxels"] = source.active_voxels();
    j["leaves"] = source.leaves();
    j["bytes_in_memory"] = source.memory();
    j["dense_bytes"] = 4 * written.count;
    j["active_box_min"] = {box.min().x(), box.min().y(), box.min().z()};
    j["active_box_max"] = {box.max().x(), box.max().y(), box.max().z()};
    return j;
}

}  // namespace

void add_map_output_flags(CLI::App& app, MrcWriteOptions& options) {
    app.add_option_function<std::string>(
           "--compress", [&options](const std::string&) { options.compress = MrcWriteOptions::Compress::gz; },
           "Compress a map file: gz; implied by the ending .gz [no]")
        ->check(CLI::IsMember({"gz"}));
    app.add_option_function<std::string>(
        "--scale", [&options](const std::string& text) { set_scaling(text, options); },
        "How values become a map file's numbers in modes that do not hold every value: none, auto, or "
        "FACTOR[,OFFSET] with value = FACTOR * stored + OFFSET [none]");
}

void report_written(const std::string& path, const MrcWriteReport& report, Json& result, Session& session) {
    const MrcScaling scaling = report.scaling.value_or(MrcScaling());
    result["mode"] = report.mode;
    result["scaling"] = {
        {"factor", scaling.factor}, {"offset", scaling.offset}, {"largest_error", report.largest_error}};
    if (session.json || session.quiet || (!report.scaling && report.largest_error == 0)) return;
    session.say(fmt::format("{}: mode {}, density = {} * stored + {}, largest error {:.3g}", path,
                            report.mode, scaling.factor, scaling.offset, report.largest_error));
}

Json convert_grid_to_map(const std::string& in, const std::string& out,
                         const std::optional<std::string>& grid, const MrcWriteOptions& options,
                         Session& session) {
    Json seconds;
    Clock clock;
    const VdbSections source(in, grid);
    seconds["read"] = clock.lap();
    if (source.active_voxels() == 0)
        throw NumericalError(fmt::format("{}: no sample is kept: the grid has no active voxel", in));
    const MrcWriteReport report = write_mrc(source, out, options, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    Json j{{"in", in}, {"out", out}};
    j.update(unloaded_grid_json(source, report.statistics));
    j["warnings"] = Json::array();
    j["seconds"] = seconds;
    if (!session.json && !session.quiet)
        session.say(fmt::format("{}: {} active voxels, {:.1f} MB of samples", out, source.active_voxels(),
                                j["dense_bytes"].get<double>() / 1e6));
    report_written(out, report, j, session);
    return j;
}

Json convert_map_to_map(const std::string& in, const std::string& out, const MapReadOptions& read,
                        const MrcWriteOptions& write, Session& session) {
    Clock clock;
    const MapCopy copy = copy_map(in, out, read, write, session.stage("converting"));
    const double seconds = clock.lap();
    session.end_stage();
    for (const std::string& w : copy.warnings) session.warn(in + ": " + w);
    const Statistics& s = copy.report.statistics;
    Json j{{"in", in}, {"out", out}};
    j.update(frame_json(copy.frame));
    j.update(statistics_json(s));
    j["warnings"] = copy.warnings;
    j["notes"] = copy.notes;
    j["seconds"] = {{"convert", seconds}};
    if (!session.json && !session.quiet) {
        for (const std::string& note : copy.notes) session.say(in + ": " + note);
        session.say(fmt::format("{}: {} x {} x {} samples, {:.6g} to {:.6g}", out, copy.frame.size.x(),
                                copy.frame.size.y(), copy.frame.size.z(), s.min, s.max));
    }
    report_written(out, copy.report, j, session);
    return j;
}

}  // namespace vdbgeo::app
