#include "apps/model_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "apps/model_stages.h"
#include "apps/reports.h"
#include "apps/subcommand.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/file_hash.h"
#include "vdbgeo/view/render.h"

namespace vdbgeo::app {
namespace {

namespace fs = std::filesystem;

class ModelRun {
 public:
    ModelRun(const ModelOptions& options, Session& session, const RunLine& run_line)
        : options_(options), session_(session), run_line_(run_line) {
        state_.in = options.in;
        state_.by_team = session.team != nullptr;
        state_.folder = options.folder;
        state_.sections = options.sections();
        if (!can_render()) {
            session.warn("this build has no ray caster (embree): there will be no pictures");
            state_.sections["pictures"] = false;
        }
        check_sections(state_.sections);
        old_ = read_old();
        summary_ = {{"program", "vdbgeo"},      {"input", options.in},       {"status", "running"},
                    {"preset", options.preset}, {"options", options_json()}, {"versions", versions_json()},
                    {"seconds", 0.0},           {"stages", Json::array()}};
        program_ = file_hash("/proc/self/exe");
    }

    Json run();

 private:
    Json options_json() const {
        Json all{{"preset", options_.preset}};
        all.update(options_.given);
        return all;
    }
    Json read_old() const;
    const Json* old_entry(const std::string& name) const;
    std::string key_of(const ModelStage& stage, const ModelStage::Lines& lines) const;
    std::string input_hash(const std::string& name) const;
    bool files_are_as_left(const Json& entry) const;
    bool files_are_there(const ModelStage& stage) const;
    void taken_over(const ModelStage& stage, const Json& old);
    void taken_as_it_is(const ModelStage& stage);
    void run_stage(const ModelStage& stage, const ModelStage::Lines& lines, const std::string& key);
    void remove_stale_files(const ModelStage& stage) const;
    void give_up(const ModelStage& stage);
    std::optional<std::string> missing_input(const ModelStage& stage) const;
    void tell(const std::vector<std::string>& warnings);
    void keep(Json entry);
    void write_summary();
    void make_folder();

    const ModelOptions& options_;
    Session& session_;
    const RunLine& run_line_;
    ModelState state_;
    Json old_, summary_;
    std::string program_;
    bool made_folder_ = false;
    Clock clock_;
    mutable std::map<std::string, std::string> hashes_;  ///< of files of the folder, "" is the map
    std::set<std::string> told_;
    std::vector<std::string> failures_;
};

/// The summary of the last run, or an empty object: what cannot be read is not taken over.
Json ModelRun::read_old() const {
    const std::string path = state_.at("summary.json");
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return Json::object();
    std::ifstream in(path, std::ios::binary);
    std::stringstream text;
    text << in.rdbuf();
    const Json old = Json::parse(text.str(), nullptr, false);
    return old.is_object() && old.contains("stages") && old["stages"].is_array() ? old : Json::object();
}

const Json* ModelRun::old_entry(const std::string& name) const {
    if (!old_.contains("stages")) return nullptr;
    for (const Json& entry : old_["stages"])
        if (entry.is_object() && entry.value("name", Json()) == Json(name)) return &entry;
    return nullptr;
}

std::string ModelRun::input_hash(const std::string& name) const {
    const auto found = hashes_.find(name);
    if (found != hashes_.end()) return found->second;
    const std::string path = name.empty() ? state_.in : state_.at(name);
    std::error_code error;
    return hashes_[name] = fs::is_regular_file(path, error) ? file_hash(path) : "none";
}

/// Program, command lines without the folder's and the map's names, and what the input files hold.
std::string ModelRun::key_of(const ModelStage& stage, const ModelStage::Lines& lines) const {
    std::string text = program_;
    const std::string prefix = state_.at("");
    for (const auto& line : lines) {
        text += '\n';
        for (const std::string& word : line)
            text += '\0' + (word == state_.in            ? ""
                            : word.rfind(prefix, 0) == 0 ? word.substr(prefix.size())
                                                         : word);
    }
    for (const std::string& name : stage.inputs(state_)) text += '\n' + name + '\0' + input_hash(name);
    return text_hash(text);
}

bool ModelRun::files_are_as_left(const Json& entry) const {
    const Json files = entry.value("files", Json::array());
    for (const Json& file : files) {
        const std::string name = file.value("name", ""), path = state_.at(name);
        std::error_code error;
        if (name.empty() || !fs::is_regular_file(path, error)) return false;
        if (fs::file_size(path, error) != file.value("bytes", std::uint64_t(0)) || error) return false;
        const std::string hash = file_hash(path);
        if (hash != file.value("hash", "")) return false;
        hashes_[name] = hash;
    }
    return !files.empty();
}

bool ModelRun::files_are_there(const ModelStage& stage) const {
    const auto names = stage.outputs(state_);
    return std::all_of(names.begin(), names.end(), [&](const std::string& name) {
        std::error_code error;
        return fs::is_regular_file(state_.at(name), error);
    });
}

void ModelRun::taken_over(const ModelStage& stage, const Json& old) {
    Json entry = old;
    entry["status"] = "reused";
    if (entry.contains("result")) state_.results[stage.name] = entry["result"];
    keep(std::move(entry));
}

/// A stage before --from: whatever it left is used, even where it was changed by hand.
void ModelRun::taken_as_it_is(const ModelStage& stage) {
    const Json* old = old_entry(stage.name);
    if (stage.essential && !files_are_there(stage))
        throw InvalidInput(
            fmt::format("{}: {} is not there, which the stage {} leaves; begin earlier than --from {}",
                        options_.folder, stage.outputs(state_)[0], stage.name, options_.from));
    if (old) return taken_over(stage, *old);
    keep({{"name", stage.name}, {"title", stage.title}, {"status", "reused"}});
}

/// What an earlier run left of a stage and this one has not made: the report would show it as this one's.
void ModelRun::remove_stale_files(const ModelStage& stage) const {
    const Json* old = old_entry(stage.name);
    if (!old) return;
    const ModelStage::Names made = stage.outputs(state_);
    for (const Json& file : old->value("files", Json::array())) {
        const Json told = file.is_object() ? file.value("name", Json()) : Json();
        const std::string name = told.is_string() ? told.get<std::string>() : "";
        const bool plain = !name.empty() && fs::path(name).filename() == name;  // summaries can be edited
        std::error_code error;
        if (plain && std::find(made.begin(), made.end(), name) == made.end() &&
            fs::is_regular_file(state_.at(name), error))
            fs::remove(state_.at(name), error);
    }
}

/// Later stages do without what this one should have left.
void ModelRun::give_up(const ModelStage& stage) {
    failures_.push_back(stage.name);
    state_.sections[stage.name] = false;
}

/// The first file that a stage needs and that is not there.
std::optional<std::string> ModelRun::missing_input(const ModelStage& stage) const {
    for (const std::string& name : stage.inputs(state_)) {
        std::error_code error;
        if (!name.empty() && !fs::exists(state_.at(name), error)) return name;
    }
    return {};
}

void ModelRun::tell(const std::vector<std::string>& warnings) {
    for (const std::string& w : warnings)
        if (told_.insert(w).second) session_.warn(w);
}

void ModelRun::keep(Json entry) {
    summary_["stages"].push_back(std::move(entry));
    write_summary();
}

/// Stages that this run has not come to are told as an earlier one left them, so that a run that is broken
/// off takes nothing away.
void ModelRun::write_summary() {
    summary_["seconds"] = clock_.seconds();
    Json all = summary_;
    for (const ModelStage& stage : model_stages()) {
        const auto& so_far = summary_["stages"];
        const bool here = std::any_of(so_far.begin(), so_far.end(),
                                      [&](const Json& entry) { return entry["name"] == stage.name; });
        const Json* old = old_entry(stage.name);
        if (here || !old || !state_.on(stage.name)) continue;
        all["stages"].push_back(*old);
        all["stages"].back()["status"] = "earlier";
    }
    write_file(state_.at("summary.json"), json_text(all, 2) + "\n");
    hashes_.erase("summary.json");
}

/// The folder is made for the map's stage, and goes again where nothing could be made of the map.
void ModelRun::make_folder() {
    std::error_code error;
    made_folder_ = fs::create_directories(options_.folder, error);
    if (error) throw IoError(fmt::format("{}: cannot be made: {}", options_.folder, error.message()));
}

void ModelRun::run_stage(const ModelStage& stage, const ModelStage::Lines& lines, const std::string& key) {
    Json entry{{"name", stage.name}, {"title", stage.title}, {"status", "done"},         {"commands", lines},
               {"seconds", 0.0},     {"key", key},           {"warnings", Json::array()}};
    Clock clock;
    const Progress progress = session_.stage(stage.name);
    const auto failed = [&](const char* status, const std::string& why) {
        session_.drop_stage();
        entry["status"] = status;
        entry["error"] = why;
        entry["seconds"] = clock.seconds();
        std::error_code error;
        if (made_folder_ && summary_["stages"].empty() && fs::remove(options_.folder, error)) return;
        summary_["status"] = status;
        keep(entry);
    };
    try {
        for (const auto& line : lines) {
            progress.report(0);
            const Session::Kept kept = run_line_(line, stage.name);
            // The first line's result is the stage's; pictures have none worth keeping.
            if (!entry.contains("result") && std::string(stage.name) != "pictures")
                entry["result"] = kept.result;
            for (const std::string& w : kept.warnings) entry["warnings"].push_back(w);
        }
    } catch (const Cancelled& e) {
        failed("interrupted", e.what());
        throw;
    } catch (const UsageError& e) {
        failed("failed", e.what());
        throw;
    } catch (const IoError& e) {  // a disk that is full for this stage is full for the next
        failed("failed", e.what());
        throw;
    } catch (const std::exception& e) {
        failed("failed", e.what());
        if (stage.essential) throw;
        session_.warn(fmt::format("{} failed: {}", stage.name, e.what()));
        give_up(stage);
        return;
    }
    entry["seconds"] = clock.seconds();
    remove_stale_files(stage);
    Json files = Json::array();
    for (const std::string& name : stage.outputs(state_)) {
        hashes_.erase(name);
        std::error_code error;
        if (!fs::is_regular_file(state_.at(name), error)) continue;
        files.push_back(
            {{"name", name}, {"bytes", fs::file_size(state_.at(name))}, {"hash", input_hash(name)}});
    }
    entry["files"] = files;
    if (entry.contains("result")) state_.results[stage.name] = entry["result"];
    session_.end_stage();
    tell(entry["warnings"].get<std::vector<std::string>>());
    keep(std::move(entry));
}

Json ModelRun::run() {
    const auto& stages = model_stages();
    const auto place = [&](const std::string& name, std::size_t otherwise) {
        if (name.empty()) return otherwise;
        return static_cast<std::size_t>(find_stage(name) - stages.data());
    };
    if (!options_.from.empty() && place(options_.from, 0) > place(options_.to, stages.size()))
        throw UsageError(fmt::format("--from {} comes after --to {}", options_.from, options_.to));
    const std::size_t first = place(options_.from, 0), last = place(options_.to, stages.size() - 1);
    for (std::size_t i = first; i <= last; ++i)  // nothing is begun that cannot be ended
        if (state_.on(stages[i].name))
            for (const auto& line : stages[i].lines(state_)) check_words(line);
    std::error_code error;
    if (first > 0 && !fs::is_directory(options_.folder, error))
        throw InvalidInput(
            fmt::format("{}: there is no such folder; --from {} takes what earlier stages left there",
                        options_.folder, options_.from));
    make_folder();
    for (std::size_t i = 0; i <= last; ++i) {
        const ModelStage& stage = stages[i];
        // The page tells how the run went: the report comes last.
        summary_["status"] = i + 1 < stages.size() ? "running" : failures_.empty() ? "done" : "failed";
        if (i + 1 == stages.size()) write_summary();
        if (!state_.on(stage.name)) {
            keep({{"name", stage.name}, {"title", stage.title}, {"status", "off"}});
            continue;
        }
        if (i < first) {
            taken_as_it_is(stage);
            continue;
        }
        if (const auto missing = missing_input(stage)) {
            const std::string why = fmt::format("needs {}, which is not there", *missing);
            keep({{"name", stage.name}, {"title", stage.title}, {"status", "failed"}, {"error", why}});
            if (stage.essential)
                throw InvalidInput(fmt::format("{}: {} {}", options_.folder, stage.name, why));
            session_.warn(fmt::format("{} {}", stage.name, why));
            give_up(stage);
            continue;
        }
        const auto lines = stage.lines(state_);
        const std::string key = key_of(stage, lines);
        const Json* old = options_.fresh ? nullptr : old_entry(stage.name);
        const bool same = old && old->value("key", "") == key && old->value("status", "") != "failed" &&
                          old->value("status", "") != "interrupted";
        if (same && files_are_as_left(*old))
            taken_over(stage, *old);
        else
            run_stage(stage, lines, key);
    }
    summary_["status"] = failures_.empty() ? "done" : "failed";
    write_summary();
    if (!failures_.empty())
        throw NumericalError(fmt::format("{}: {} failed, the rest is there; summary.json tells why",
                                         options_.folder, fmt::join(failures_, ", ")));
    return summary_;
}

}  // namespace

Json run_model(const ModelOptions& options, Session& session, const RunLine& run) {
    return ModelRun(options, session, run).run();
}

}  // namespace vdbgeo::app
