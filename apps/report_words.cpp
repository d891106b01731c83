#include "apps/report_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "apps/report_glossary.h"

namespace vdbgeo::app {
namespace {

bool ends_with(const std::string& text, const std::string& ending) {
    return text.size() > ending.size() &&
           text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

/// The endings that tell a unit, the longer ones first.
const std::vector<std::pair<std::string, std::string>>& unit_endings() {
    static const std::vector<std::pair<std::string, std::string>> endings{
        {"_per_A2", "1/Å²"}, {"_per_A", "1/Å"},    {"_A3", "Å³"},     {"_A2", "Å²"},
        {"_A", "Å"},         {"_deg", "°"},        {"_percent", "%"}, {"_bytes", "bytes"},
        {"_seconds", "s"},   {"_voxels", "voxels"}};
    return endings;
}

/// Digits in groups of three.
std::string grouped(std::string digits) {
    const std::size_t start = digits[0] == '-' ? 1 : 0, point = std::min(digits.find('.'), digits.size());
    for (std::size_t at = point; at > start + 3; at -= 3) digits.insert(at - 3, ",");
    return digits;
}

std::string superscript(int number) {
    static const char* digits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    std::string text = number < 0 ? "⁻" : "";
    for (const char c : std::to_string(std::abs(number))) text += digits[c - '0'];
    return text;
}

std::string list_text(const Json& list) {
    constexpr std::size_t most = 6;
    if (list.empty()) return "none";
    const bool numbers = std::all_of(list.begin(), list.end(), [](const Json& v) { return v.is_number(); });
    if (list.size() > most) {
        if (!numbers) return fmt::format("{} entries", list.size());
        double low = list[0].get<double>(), high = low;
        for (const Json& v : list)
            low = std::min(low, v.get<double>()), high = std::max(high, v.get<double>());
        return fmt::format("{} numbers from {} to {}", list.size(), number_text(low), number_text(high));
    }
    std::string text;
    for (const Json& v : list) text += (text.empty() ? "" : ", ") + (v.is_object() ? "…" : value_text(v));
    return text;
}

/// "Mean" within a line becomes "mean"; "H" and "Å" stay.
std::string lower_first(std::string text) {
    if (text.size() > 1 && text[0] >= 'A' && text[0] <= 'Z' && text[1] >= 'a' && text[1] <= 'z')
        text[0] = static_cast<char>(text[0] - 'A' + 'a');
    return text;
}

/// Names of files, and what the page tells elsewhere.
bool is_told_elsewhere(const std::string& key) {
    static const std::vector<std::string> keys{
        "name", "file", "in",      "out",   "files",    "preview",  "slices", "spectra", "histogram", "plane",
        "plot", "mesh", "picture", "table", "metadata", "warnings", "notes",  "list",    "listed"};
    return std::find(keys.begin(), keys.end(), key) != keys.end();
}

void add_rows(std::vector<std::vector<std::string>>& rows, const KeyWords& above, const Json& object,
              int depth);

/// A long list of objects is told by its length.
void add_row(std::vector<std::vector<std::string>>& rows, const KeyWords& words, const Json& value,
             int depth) {
    constexpr int deepest = 4;
    constexpr std::size_t most_objects = 4;
    const bool objects = value.is_array() && !value.empty() && value[0].is_object();
    if (depth < deepest && value.is_object()) return add_rows(rows, words, value, depth + 1);
    if (depth < deepest && objects && value.size() <= most_objects) {
        for (std::size_t i = 0; i < value.size(); ++i) {
            KeyWords one = words;
            if (value.size() > 1) one.label += fmt::format(" {}", i + 1);
            if (value[i].is_object()) add_rows(rows, one, value[i], depth + 1);
        }
        return;
    }
    // A length with nothing in it needs no unit, nor do words.
    const bool counted = value.is_number() || (value.is_array() && !objects);
    rows.push_back(
        {words.label, value.is_object() ? "…" : value_text(value), counted ? words.unit : "", words.help});
}

void add_rows(std::vector<std::vector<std::string>>& rows, const KeyWords& above, const Json& object,
              int depth) {
    for (const auto& [key, value] : object.items()) {
        if (depth == 0 && is_told_elsewhere(key)) continue;
        KeyWords words = words_for(key);
        if (above.label == words_for("seconds").label) words = {words.label, above.unit, ""};
        if (!above.label.empty()) {
            // Of "H_per_A": {"mean": …} the unit and the meaning stand above.
            const bool statistic = words.unit.empty() && !above.unit.empty();
            words.label = above.label + ": " + lower_first(words.label);
            if (statistic) words.unit = above.unit;
            if (words.help.empty())
                words.help = above.help;
            else if (statistic && !above.help.empty())
                words.help = above.help + " " + words.help;
        }
        add_row(rows, words, value, depth);
    }
}

}  // namespace

KeyWords words_for(const std::string& key) {
    if (const KeyWords* known = find_words(key)) return *known;
    KeyWords words;
    std::string name = key;
    for (const auto& [ending, unit] : unit_endings())
        if (ends_with(name, ending)) {
            words.unit = unit;
            name.resize(name.size() - ending.size());
            break;
        }
    if (name == "bytes" || name == "seconds") words.unit = name == "bytes" ? "bytes" : "s";
    std::replace(name.begin(), name.end(), '_', ' ');
    if (!name.empty() && name.size() > 2 && name[0] >= 'a' && name[0] <= 'z')
        name[0] = static_cast<char>(name[0] - 'a' + 'A');
    words.label = name;
    return words;
}

std::string count_text(std::uint64_t count) { return grouped(std::to_string(count)); }

std::string number_text(double value) {
    if (!std::isfinite(value)) return "–";
    if (value == 0) return "0";
    const double size = std::abs(value);
    if (value == std::round(value) && size < 1e15) return grouped(fmt::format("{:.0f}", value));
    if (size >= 1e9 || size < 1e-3) {
        int power = static_cast<int>(std::floor(std::log10(size)));
        std::string digits = fmt::format("{:.3g}", value / std::pow(10.0, power));
        if (digits == "10" || digits == "-10") digits = digits[0] == '-' ? "-1" : "1", ++power;
        return fmt::format("{} × 10{}", digits, superscript(power));
    }
    // Four digits; all of them before the point.
    const int before = static_cast<int>(std::floor(std::log10(size))) + 1;
    std::string digits = fmt::format("{:.{}f}", value, std::clamp(4 - before, 0, 6));
    if (digits.find('.') != std::string::npos) {
        while (digits.back() == '0') digits.pop_back();
        if (digits.back() == '.') digits.pop_back();
    }
    return grouped(digits);
}

std::string decimal_text(double value, int digits) {
    if (!(std::abs(value) < 1e15)) return number_text(value);
    const std::string text = fmt::format("{:.{}f}", value, digits);
    const bool nothing = text.find_first_not_of("-0.") == std::string::npos;  // −0.0
    return nothing && text[0] == '-' ? text.substr(1) : grouped(text);
}

std::string value_text(const Json& value) {
    if (value.is_null()) return "–";
    if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
    if (value.is_number_unsigned()) return count_text(value.get<std::uint64_t>());
    if (value.is_number()) return number_text(value.get<double>());
    if (value.is_string()) return value.get<std::string>();
    if (value.is_array()) return list_text(value);
    return json_text(value);
}

std::vector<std::vector<std::string>> result_rows(const Json& result) {
    std::vector<std::vector<std::string>> rows;
    if (result.is_object()) add_rows(rows, {}, result, 0);
    return rows;
}

std::string time_text(double seconds) {
    if (!(seconds >= 0) || !std::isfinite(seconds)) return {};
    if (seconds < 0.1) return "less than 0.1 s";
    if (seconds < 60) return fmt::format("{:.1f} s", seconds);
    const auto whole = static_cast<std::uint64_t>(seconds + 0.5);
    if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
    return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace vdbgeo::app
