// vdbgeo transform: a map as a sum of modes from fine to coarse, or some of them as one map.
#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>

#include "apps/command.h"
#include "apps/flow_flags.h"
#include "apps/map_filter.h"
#include "apps/map_output.h"
#include "apps/preview.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo::app {
namespace {

namespace fs = std::filesystem;

struct TransformCommandOptions {
    MapFilterFlags files;
    TransformFlags transform;
    std::string format;
    std::string prefix, ending;  ///< of the files to write

    bool one_file() const { return !transform.kept.empty(); }
    std::size_t modes() const { return transform.options.passes.size(); }
    void finish(Session& session);
};

/// "a/modes.mrc.gz" → ".mrc.gz"; nothing where the name does not end as a map's.
std::string map_ending(const std::string& name) {
    const std::string file = fs::path(name).filename().string();
    for (const char* packed : {".gz", ".bz2", ".zst"})
        if (has_ending(file, packed)) {
            const std::string rest = file.substr(0, file.size() - std::strlen(packed));
            return is_map_ending(rest) ? fs::path(rest).extension().string() + packed : "";
        }
    return is_map_ending(file) || is_vdb_ending(file) || has_ending(file, ".nvdb")
               ? fs::path(file).extension().string()
               : "";
}

void TransformCommandOptions::finish(Session& session) {
    files.finish();
    transform.finish();
    if (files.out == "-") {
        if (!one_file())
            throw UsageError("-: standard output takes one map: choose by --keep or --band-pass");
        if (!format.empty()) throw UsageError("-: standard output takes an MRC map, whatever --format says");
        return check_map_output(files.out, session);
    }
    ending = map_ending(files.out);
    prefix = files.out.substr(0, files.out.size() - ending.size());
    if (!format.empty()) {
        if (!ending.empty() && ending != "." + format)
            throw UsageError(fmt::format("{}: its ending and --format {} differ", files.out, format));
        ending = "." + format;
    } else if (ending.empty()) {
        ending = is_vdb_ending(files.in) ? ".vdb" : ".mrc";
    }
    files.out = prefix + ending;
    check_map_output(files.out, session);
}

/// Files that appear together: written into a hidden folder beside their places, and moved there once all are
/// whole. What is not moved is removed.
class FileSet {
 public:
    explicit FileSet(const std::string& prefix) : place_(fs::path(prefix).parent_path()) {
        if (place_.empty()) place_ = ".";
        std::string name = (place_ / ".vdbgeo-XXXXXX").string();
        if (!mkdtemp(name.data()))
            throw IoError(fmt::format("{}: cannot be written: {}", prefix, std::strerror(errno)));
        folder_ = name;
    }
    ~FileSet() {
        std::error_code ignored;
        fs::remove_all(folder_, ignored);
    }
    FileSet(const FileSet&) = delete;
    FileSet& operator=(const FileSet&) = delete;

    /// Where to write the file that is to be called `name`.
    std::string add(const std::string& name) {
        names_.push_back(fs::path(name).filename().string());
        return (folder_ / names_.back()).string();
    }
    void commit() {
        for (const std::string& name : names_) {
            std::error_code error;
            if (fs::is_directory(place_ / name, error))
                throw IoError(fmt::format("{}: cannot be written: it is a folder", (place_ / name).string()));
        }
        for (const std::string& name : names_) {
            std::error_code error;
            fs::rename(folder_ / name, place_ / name, error);
            if (error)
                throw IoError(
                    fmt::format("{}: cannot be written: {}", (place_ / name).string(), error.message()));
        }
    }

 private:
    fs::path place_, folder_;
    std::vector<std::string> names_;
};

/// a = a + b in the active voxels; both have the same leaves.
void add_to(openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
    std::vector<leaf::Leaf*> leaves;
    a.tree().getNodes(leaves);
    parallel_for(leaves.size(), 64, [&](std::size_t i) {
        const leaf::Leaf* other = b.constTree().probeConstLeaf(leaves[i]->origin());
        const float* from = other->buffer().data();
        float* to = leaves[i]->buffer().data();
        for (auto it = leaves[i]->cbeginValueOn(); it; ++it) to[it.pos()] += from[it.pos()];
    });
}

/// Takes the modes as they come.
class Modes {
 public:
    Modes(const TransformCommandOptions& o, const MapFile& in, Session& session)
        : o_(o), in_(in), session_(session), shown_(!o.files.preview.empty()) {
        if (shown_) preview_.add("map", in.map, Preview::Greys::own);
        if (!o.one_file()) files_ = std::make_unique<FileSet>(o.prefix);
    }

    void take(int number, const openvdb::FloatGrid::Ptr& grid, const HyperdiffusionReport& report) {
        const auto k = static_cast<std::size_t>(number);
        const bool residue = k == o_.modes();
        if (!residue) clear_inactive(*grid);
        DensityMap map{grid, in_.map.frame, {}};
        const std::string name = residue ? "residue" : fmt::format("mode {}", k + 1);
        finish_map(map, fmt::format("{} of the transform: {}", name, settings()));
        Json j{{"name", name}};
        if (!residue) {
            const TransformOptions::Pass& pass = o_.transform.options.passes[k];
            j.update(
                {{"order", pass.order}, {"time", pass.time}, {"dt", report.dt}, {"steps", report.steps}});
        }
        j.update(statistics_json(map.statistics));
        if (shown_) preview_.add(name, map, Preview::Greys::own);
        if (o_.one_file()) {
            j["kept"] = bool(o_.transform.kept[k]);
            if (o_.transform.kept[k]) keep(map);
        } else {
            const std::string file = residue ? o_.prefix + "_residue" + o_.ending
                                             : fmt::format("{}_mode_{}{}", o_.prefix, k + 1, o_.ending);
            write_map(map, files_->add(file), o_.files.vdb, o_.files.mrc, {});
            j["file"] = file;
        }
        modes_.push_back(j);
    }

    /// Writes what is left to be written.
    Json finish() {
        Json j = filter_result(o_.files, in_);
        j["sigma"] = o_.transform.options.sigma.text();
        j["stepper"] = name_of(o_.transform.options.stepper);
        j["modes"] = modes_;
        if (o_.one_file()) {
            finish_map(sum_, fmt::format("sum of {} of the transform: {}", kept_text(), settings()));
            j.update(statistics_json(sum_.statistics));
            write_filtered(o_.files, sum_, j, session_);
        } else {
            files_->commit();
            j.erase("out");
        }
        if (shown_) {
            preview_.write(o_.files.preview);
            j["preview"] = o_.files.preview;
        }
        return j;
    }

    std::string settings() const {
        std::string text;
        for (const TransformOptions::Pass& pass : o_.transform.options.passes)
            text += fmt::format("{}order {} time {}", text.empty() ? "" : ", ", pass.order, pass.time);
        return text + ", sigma " + o_.transform.options.sigma.text();
    }

 private:
    std::string kept_text() const {
        std::string text;
        for (std::size_t k = 0; k <= o_.modes(); ++k)
            if (o_.transform.kept[k])
                text += (text.empty() ? "" : ", ") +
                        (k == o_.modes() ? "residue" : fmt::format("mode {}", k + 1));
        return text;
    }

    void keep(const DensityMap& map) {
        if (!sum_.grid) {
            sum_ = map;
            return;
        }
        // The residue comes last: what is inactive in it is inactive in the sum.
        const DensityMap before = sum_;
        if (static_cast<std::size_t>(modes_.size()) == o_.modes()) {
            sum_ = map;
            add_to(*sum_.grid, *before.grid);
        } else {
            add_to(*sum_.grid, *map.grid);
        }
    }

    const TransformCommandOptions& o_;
    const MapFile& in_;
    Session& session_;
    const bool shown_;
    Preview preview_;
    std::unique_ptr<FileSet> files_;
    DensityMap sum_;
    Json modes_ = Json::array();
};

void say_modes(const Json& j, const TransformCommandOptions& o, Session& session) {
    if (session.json || session.quiet) return;
    for (const Json& mode : j["modes"]) {
        std::string line = fmt::format("{:<11} ", mode["name"].get<std::string>());
        if (mode.contains("order"))
            line += fmt::format("order {}, time {:.6g}, {} steps; ", mode["order"].get<int>(),
                                mode["time"].get<double>(), mode["steps"].get<int>());
        line += fmt::format("{:.4g} to {:.4g}, rms {:.4g}", mode["min"].get<double>(),
                            mode["max"].get<double>(), mode["rms"].get<double>());
        if (mode.contains("file")) line += ": " + mode["file"].get<std::string>();
        if (mode.contains("kept") && mode["kept"].get<bool>()) line += ": in " + o.files.out;
        session.say(line);
    }
}

void run_transform(const TransformCommandOptions& o, Session& session) {
    Json seconds;
    Clock clock;
    const MapFile in = read_for_filter(o.files, {"the transform", 32.8}, session);
    need_density(o.files.in, in);
    seconds["read"] = clock.lap();
    const Progress progress = session.stage("transform");
    Modes modes(o, in, session);
    naming(o.files.in, [&] {
        pde_transform(
            *in.map.grid, o.transform.options,
            [&](int k, const openvdb::FloatGrid::Ptr& grid, const HyperdiffusionReport& report) {
                modes.take(k, grid, report);
            },
            progress);
    });
    progress.report(1);
    seconds["compute"] = clock.lap();
    Json j = modes.finish();
    seconds["write"] = clock.lap();
    session.end_stage();
    j["active_voxels"] = in.map.grid->activeVoxelCount();
    j["seconds"] = seconds;
    say_modes(j, o, session);
    session.result(j);
}

}  // namespace

Command transform_command() {
    return {"transform", "Take a map apart into modes, from fine to coarse, or write some of them as one map",
            "  vdbgeo transform emd_1080.map groel.mrc\n"
            "  vdbgeo transform emd_1080.map band.mrc --band-pass 1:100 --orders 1",
            [](CLI::App& app) {
                auto o = std::make_shared<TransformCommandOptions>();
                o->transform.add(app);
                app.add_option("--format", o->format,
                               "Ending of the files: mrc, map, ccp4, rec, vdb or nvdb "
                               "[that of OUT, else of IN]")
                    ->check(CLI::IsMember({"mrc", "map", "ccp4", "rec", "vdb", "nvdb"}).description(""));
                o->files.add(
                    app,
                    "Beginning of the files' names: OUT_mode_1.mrc and so on, and OUT_residue.mrc; or, with "
                    "--keep and --band-pass, the map to write (- is an MRC map for a pipe)");
                o->files.add_preview(app,
                                     "Picture (PNG) of sections and power spectra of the map and its modes");
                return [o](Session& session) {
                    o->finish(session);
                    run_transform(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
