#include "apps/report_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>

#include "apps/report_words.h"
#include "apps/subcommand.h"
#include "vdbgeo/view/page_images.h"

namespace vdbgeo::app {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t most_bytes = 256u << 20;  ///< of a file that is read whole
constexpr int deepest = 32;                        ///< objects in objects in summary.json

/// A file that a run leaves, and the stages without which it does not.
struct Expected {
    const char* file;
    std::vector<const char*> stages;
};

const std::vector<Expected>& expected_files() {
    static const std::vector<Expected> files{{"density.vdb", {"map"}},
                                             {"smooth.vdb", {"denoise"}},
                                             {"slices_before_x.png", {"denoise"}},
                                             {"slices_before_y.png", {"denoise"}},
                                             {"slices_before_z.png", {"denoise"}},
                                             {"slices_after_x.png", {"denoise"}},
                                             {"slices_after_y.png", {"denoise"}},
                                             {"slices_after_z.png", {"denoise"}},
                                             {"spectra.svg", {"denoise"}},
                                             {"density.svg", {"statistics"}},
                                             {"isovalues.svg", {"statistics"}},
                                             {"surface.ply", {"surface"}},
                                             {"mesh.ply", {"remesh"}},
                                             {"angles.svg", {"measure"}},
                                             {"curved.ply", {"curvature"}},
                                             {"curvature.svg", {"curvature"}},
                                             {"k1k2.svg", {"curvature"}},
                                             {"pockets.csv", {"pockets"}},
                                             {"pockets.json", {"pockets"}},
                                             {"pockets.ply", {"pockets"}},
                                             {"tets.vtu", {"tets"}},
                                             {"dihedrals.svg", {"tets"}},
                                             {"map.png", {"pictures"}},
                                             {"denoised.png", {"pictures", "denoise"}},
                                             {"meshes.png", {"pictures", "remesh"}},
                                             {"gaussian.png", {"pictures", "curvature"}},
                                             {"mean.png", {"pictures", "curvature"}},
                                             {"k1.png", {"pictures", "curvature"}},
                                             {"k2.png", {"pictures", "curvature"}},
                                             {"pockets_picture.png", {"pictures", "pockets"}},
                                             {"cut.png", {"pictures", "tets"}},
                                             {"peel.png", {"pictures", "tets"}}};
    return files;
}

std::string read_whole(const fs::path& path) {
    std::error_code error;
    if (fs::file_size(path, error) > most_bytes || error)
        throw IoError(error ? "cannot be read: " + error.message() : "is too large for a page");
    std::ifstream in(path, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(in), {}};
    if (in.bad() || !in.is_open()) throw IoError("cannot be read");
    return bytes;
}

std::string text_of(const Json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

std::optional<double> number_of(const Json& object, const char* key) {
    const auto found = object.find(key);
    if (found == object.end() || !found->is_number()) return {};
    return found->get<double>();
}

/// The command lines of a stage as they are typed, one a line.
std::string commands_of(const Json& stage) {
    const auto lines = stage.find("commands");
    std::string text;
    if (lines == stage.end() || !lines->is_array()) return text;
    for (const Json& line : *lines) {
        std::vector<std::string> words;
        if (line.is_array())
            for (const Json& word : line)
                if (word.is_string()) words.push_back(word.get<std::string>());
        if (!words.empty()) text += (text.empty() ? "" : "\n") + command_line("vdbgeo", words);
    }
    return text;
}

RunStage stage_of(const Json& json) {
    RunStage stage;
    stage.name = text_of(json, "name");
    stage.title = text_of(json, "title");
    if (stage.title.empty()) stage.title = words_for(stage.name).label;
    stage.status = text_of(json, "status");
    stage.error = text_of(json, "error");
    stage.command = commands_of(json);
    stage.seconds = number_of(json, "seconds");
    const auto warnings = json.find("warnings");
    if (warnings != json.end() && warnings->is_array())
        for (const Json& w : *warnings)
            if (w.is_string()) stage.warnings.push_back(w.get<std::string>());
    const auto files = json.find("files");
    if (files != json.end() && files->is_array()) {
        stage.files.emplace();
        for (const Json& file : *files)
            if (file.is_object()) stage.files->push_back(text_of(file, "name"));
    }
    const auto result = json.find("result");
    stage.result = result != json.end() && result->is_object() ? *result : Json::object();
    return stage;
}

std::vector<std::string> csv_fields(const std::string& line) {
    std::vector<std::string> fields(1);
    bool quoted = false;
    for (std::size_t i = 0; i < line.size(); ++i) {
        if (line[i] == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"')
            fields.back() += '"', ++i;
        else if (line[i] == '"')
            quoted = !quoted;
        else if (line[i] == ',' && !quoted)
            fields.emplace_back();
        else if (line[i] != '\r')
            fields.back() += line[i];
    }
    return fields;
}

/// true and false are 1 and 0; a pocket 0, a protrusion 1.
std::optional<double> csv_number(const std::string& field) {
    if (field == "true" || field == "protrusion") return 1;
    if (field == "false" || field == "pocket") return 0;
    double value = 0;
    const auto [rest, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || rest != field.data() + field.size() || !std::isfinite(value)) return {};
    return value;
}

std::vector<PocketRow> pockets_of_csv(const std::string& text) {
    std::vector<PocketRow> rows;
    std::vector<std::string> names;
    for (std::size_t at = 0, number = 1; at < text.size(); ++number) {
        const std::size_t end = std::min(text.find('\n', at), text.size());
        const std::vector<std::string> fields = csv_fields(text.substr(at, end - at));
        at = end + 1;
        if (names.empty()) {
            names = fields;
            if (std::find(names.begin(), names.end(), "id") == names.end())
                throw InvalidInput("is no table of pockets: it has no column id");
            continue;
        }
        if (fields.size() != names.size())
            throw InvalidInput(
                fmt::format("line {} has {} fields, not {}", number, fields.size(), names.size()));
        rows.emplace_back();
        for (std::size_t i = 0; i < fields.size(); ++i)
            if (const auto value = csv_number(fields[i])) rows.back().values.emplace_back(names[i], *value);
    }
    if (names.empty()) throw InvalidInput("is empty");
    return rows;
}

std::vector<PocketRow> pockets_of_json(const std::string& text) {
    const Json json = Json::parse(text, nullptr, false);
    const auto list = json.is_object() ? json.find("list") : json.end();
    if (!json.is_object() || list == json.end() || !list->is_array())
        throw InvalidInput("is no table of pockets: it is not JSON with a list");
    std::vector<PocketRow> rows;
    for (const Json& one : *list) {
        if (!one.is_object()) throw InvalidInput("is no table of pockets: what is listed is no object");
        rows.emplace_back();
        for (const auto& [key, value] : one.items()) {
            if (value.is_number()) rows.back().values.emplace_back(key, value.get<double>());
            if (value.is_boolean()) rows.back().values.emplace_back(key, value.get<bool>() ? 1 : 0);
            if (value.is_string() && csv_number(value.get<std::string>()))
                rows.back().values.emplace_back(key, *csv_number(value.get<std::string>()));
        }
    }
    return rows;
}

/// JSON that is not too deep to walk through.
Json parsed(const std::string& text) {
    bool too_deep = false;
    const Json json = Json::parse(
        text,
        [&](int depth, Json::parse_event_t, Json&) { return !(too_deep = too_deep || depth > deepest); },
        false);
    if (too_deep || json.is_discarded()) return {};
    return json;
}

}  // namespace

std::optional<double> PocketRow::number(const std::string& column) const {
    for (const auto& [name, value] : values)
        if (name == column) return value;
    return {};
}

std::optional<double> number_in(const Json& result, const std::string& key) {
    if (!result.is_object()) return {};
    if (const auto own = number_of(result, key.c_str())) return own;
    for (const Json& value : result)
        if (value.is_object())
            if (const auto inner = number_of(value, key.c_str())) return inner;
    return {};
}

ReportFolder::ReportFolder(const std::string& path) : path_(path) {
    std::error_code error;
    if (!fs::exists(path_, error)) throw IoError(path + ": there is no such folder");
    if (!fs::is_directory(path_, error))
        throw InvalidInput(path + ": is a file; a report is on the folder of a model");
    const bool any = has("summary.json") || std::any_of(expected_files().begin(), expected_files().end(),
                                                        [&](const Expected& e) { return has(e.file); });
    if (!any)
        throw InvalidInput(path +
                           ": nothing to report on: it has none of the files that vdbgeo model writes");
    read_summary();
}

bool ReportFolder::has(const std::string& name) const {
    std::error_code error;
    return fs::exists(file(name), error);
}

void ReportFolder::read_summary() {
    const auto text =
        taken<std::string>("summary.json", [](const std::string& path) { return read_whole(path); });
    if (!text) return;
    const Json json = parsed(*text);
    if (!json.is_object()) return note_damage("summary.json", "is not the JSON that vdbgeo model writes");
    summary_ = json;
    const auto stages = json.find("stages");
    if (stages == json.end() || !stages->is_array()) return;
    for (const Json& stage : *stages)
        if (stage.is_object()) stages_.push_back(stage_of(stage));
}

const RunStage* ReportFolder::stage(const std::string& name) const {
    for (const RunStage& s : stages_)
        if (s.name == name) return &s;
    return nullptr;
}

std::string ReportFolder::text(const char* key) const { return text_of(summary_, key); }

std::optional<PagePng> ReportFolder::picture(const std::string& name, const std::string& alt) {
    return taken<PagePng>(name, [&](const std::string& path) {
        PagePng png{read_whole(path), 0, 0, alt};
        std::tie(png.width, png.height) = png_size(png.bytes);
        return png;
    });
}

std::string ReportFolder::svg(const std::string& name) {
    return taken<std::string>(name,
                              [](const std::string& path) {
                                  std::string text = read_whole(path);
                                  if (!is_svg(text)) throw InvalidInput("is not an SVG drawing");
                                  return text;
                              })
        .value_or("");
}

std::vector<PocketRow> ReportFolder::pockets() {
    auto rows = taken<std::vector<PocketRow>>(
        "pockets.json", [](const std::string& path) { return pockets_of_json(read_whole(path)); });
    if (!rows)
        rows = taken<std::vector<PocketRow>>(
            "pockets.csv", [](const std::string& path) { return pockets_of_csv(read_whole(path)); });
    return rows.value_or(std::vector<PocketRow>());
}

void ReportFolder::note_damage(const std::string& name, const std::string& why) {
    // The reader's message begins with the path; the page names the file itself.
    const std::string path = file(name).string() + ": ";
    damaged_.emplace_back(name, why.rfind(path, 0) == 0 ? why.substr(path.size()) : why);
}

PageTerms ReportFolder::missing_files() const {
    std::string names;
    for (const Expected& e : expected_files()) {
        if (has(e.file)) continue;
        const bool due =
            !has_summary() || std::all_of(e.stages.begin(), e.stages.end(), [&](const char* name) {
                const RunStage* s = stage(name);
                return s && s->done();
            });
        const RunStage* maker = stage(e.stages[0]);
        if (due && (!maker || maker->left(e.file)))
            names += (names.empty() ? "" : ", ") + std::string(e.file);
    }
    if (names.empty()) return {};
    return {{"Files", "Not in the folder: " + names + "."}};
}

PageTerms ReportFolder::missing(bool within_run) const {
    PageTerms list;
    for (const auto& [name, why] : damaged_) list.emplace_back(name, "Cannot be used: " + why + ".");
    const std::string status = text("status");
    if (!has_summary())
        list.emplace_back("The run",
                          "There is no summary of it (summary.json): it was stopped before its end, or the "
                          "folder was put together by hand. What is there is shown, without the commands and "
                          "numbers of the run.");
    else if ((status == "running" && !within_run) || status == "interrupted")
        list.emplace_back("The run",
                          status == "running"
                              ? "It had not come to its end when this page was made, or it was killed."
                              : "It was interrupted before its end.");
    else if (status == "failed")
        list.emplace_back("The run", "It failed; the stages that did are below.");
    for (const RunStage& s : stages_) {
        if (s.done() || s.status.empty() || s.name == "report") continue;
        if (s.status == "off")
            list.emplace_back(s.title, "Switched off in this run.");
        else if (s.status == "failed")
            list.emplace_back(s.title, "Failed" + (s.error.empty() ? std::string(".") : ": " + s.error));
        else if (s.status == "earlier")
            list.emplace_back(s.title, "Not come to in this run: what is shown was left by an earlier one.");
        else
            list.emplace_back(s.title,
                              "Not done (" + s.status + ")" + (s.error.empty() ? "." : ": " + s.error));
    }
    const PageTerms files = missing_files();
    list.insert(list.end(), files.begin(), files.end());
    return list;
}

}  // namespace vdbgeo::app
