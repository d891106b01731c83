#include "apps/model_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <sstream>

#include "apps/model_stages.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

/// Published maps have been filtered: hardly more than what lies near the sampling limit is taken away, while
/// raw tomograms are denoised until their noise is gone. Labels are no densities.
Json preset_sections(const std::string& name) {
    if (name == "molecule") return {{"denoise", {{"order", 1}, {"time", 0.25}}}};
    if (name == "tomogram") return {{"surface", {{"cap", true}}}, {"remesh", {{"no-distance", true}}}};
    return {{"denoise", false},
            {"statistics", false},
            {"surface", {{"labels", "all"}}},
            {"remesh", false},
            {"tets", {{"labels", "all"}}}};
}

void check_section(const std::string& where, const std::string& stage, const Json& section) {
    if (!section.is_object() && section != Json(false) && section != Json(true))
        throw InvalidInput(fmt::format("{}: {} is {}; expected an object of options, or false", where, stage,
                                       section.dump()));
    if (!section.is_object()) return;
    for (const auto& [key, value] : section.items())
        if (value.is_object() || value.is_null())
            throw InvalidInput(fmt::format("{}: {}.{} is {}; expected a number, a text, true, or an array",
                                           where, stage, key, value.dump()));
}

/// The position after blanks and comments (// and /* */) from `at` on.
std::size_t past_blanks(const std::string& text, std::size_t at) {
    while (at < text.size()) {
        if (std::isspace(static_cast<unsigned char>(text[at])))
            ++at;
        else if (text.compare(at, 2, "//") == 0)
            at = std::min(text.size(), text.find('\n', at));
        else if (text.compare(at, 2, "/*") == 0 && text.find("*/", at) != std::string::npos)
            at = text.find("*/", at) + 2;
        else
            break;
    }
    return at;
}

/// JSON without the commas that stand before a closing bracket: who comments options in and out should not
/// have to count them.
std::string without_trailing_commas(std::string text) {
    for (std::size_t at = 0; (at = past_blanks(text, at)) < text.size(); ++at) {
        if (text[at] == '"') {
            for (++at; at < text.size() && text[at] != '"'; ++at)
                if (text[at] == '\\') ++at;
        } else if (text[at] == ',') {
            const std::size_t next = past_blanks(text, at + 1);
            if (next < text.size() && (text[next] == '}' || text[next] == ']')) text[at] = ' ';
        }
    }
    return text;
}

std::string text_of(const Json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

}  // namespace

const std::vector<std::string>& ModelOptions::presets() {
    static const std::vector<std::string> names{"molecule", "tomogram", "label"};
    return names;
}

Json ModelOptions::sections() const {
    Json all = preset_sections(preset);
    merge_sections(all, given);
    return all;
}

void merge_sections(Json& sections, const Json& more) {
    for (const auto& [stage, section] : more.items()) {
        Json& mine = sections[stage];
        if (section == Json(true)) {
            if (!mine.is_object()) mine = Json::object();
        } else if (section.is_object() && mine.is_object()) {
            mine.update(section);
        } else {
            mine = section;
        }
    }
}

void read_config(const std::string& file, ModelOptions& options) {
    std::ifstream in(file, std::ios::binary);
    std::stringstream text;
    text << in.rdbuf();
    if (!in) throw IoError(fmt::format("{}: cannot be read", file));
    Json all = Json::parse(without_trailing_commas(text.str()), nullptr, false, true);
    if (!all.is_object())
        throw InvalidInput(fmt::format("{}: no JSON object of options; comments (//) are allowed", file));
    if (all.contains("stages") && all.contains("options")) {  // a summary
        if (options.in.empty() && all["input"].is_string()) options.in = all["input"].get<std::string>();
        all = all["options"];
        if (!all.is_object()) throw InvalidInput(fmt::format("{}: its options are no object", file));
    }
    for (const auto& [key, value] : all.items()) {
        if (key == "preset") {
            const auto& names = ModelOptions::presets();
            if (!value.is_string() || std::find(names.begin(), names.end(), value) == names.end())
                throw InvalidInput(
                    fmt::format("{}: preset {} is none of molecule, tomogram, label", file, value.dump()));
            options.preset = value.get<std::string>();
            continue;
        }
        if (!find_stage(key)) throw InvalidInput(fmt::format("{}: {} is no stage of a model", file, key));
        check_section(file, key, value);
        merge_sections(options.given, {{key, value}});
    }
}

void set_option(const std::string& text, Json& sections) {
    const std::size_t equals = text.find('='), dot = text.substr(0, equals).find('.');
    const std::string stage = text.substr(0, std::min(dot, equals));
    if (!find_stage(stage))
        throw UsageError(fmt::format("--set {}: {} is no stage of a model; expected STAGE.OPTION=VALUE", text,
                                     stage.empty() ? "that" : stage));
    const std::string value = equals == std::string::npos ? "true" : text.substr(equals + 1);
    const bool truth = value == "true" || value == "false";
    if (dot == std::string::npos) {
        if (!truth)
            throw UsageError(fmt::format("--set {}: expected {}=true or {}=false", text, stage, stage));
        merge_sections(sections, {{stage, value == "true"}});
        return;
    }
    const std::string key = text.substr(dot + 1, equals == std::string::npos ? equals : equals - dot - 1);
    if (key.empty()) throw UsageError(fmt::format("--set {}: expected STAGE.OPTION=VALUE", text));
    merge_sections(sections, {{stage, {{key, truth ? Json(value == "true") : Json(value)}}}});
}

std::vector<std::string> words_of(const Json& section) {
    std::vector<std::string> words;
    if (!section.is_object()) return words;
    for (const auto& [key, value] : section.items()) {
        if (value == Json(false)) continue;
        const Json values = value.is_array() ? value : Json::array({value});
        for (const Json& v : values) {
            const std::string text = text_of(v);
            if (v != Json(true) && text[0] == '-') {  // not to be taken for a flag
                words.push_back("--" + key + "=" + text);
                continue;
            }
            words.push_back("--" + key);
            if (v != Json(true)) words.push_back(text);
        }
    }
    return words;
}

}  // namespace vdbgeo::app
