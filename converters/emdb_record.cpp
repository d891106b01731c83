#include "converters/emdb_record.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

#include "converters/mapped_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using Json = nlohmann::json;

constexpr std::string_view blanks = " \t\r\n";

std::optional<double> number(std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
    text = text.substr(0, text.find_last_not_of(blanks) + 1);
    if (text.substr(0, 1) == "+") text.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
    return value;
}

/// The levels as they come: the first primary one stays, or the first of all.
class Choice {
 public:
    void add(std::optional<double> level, bool primary) {
        if (!level || primary_ || (level_ && !primary)) return;
        level_ = level;
        primary_ = primary;
    }
    std::optional<double> level() const { return level_; }

 private:
    std::optional<double> level_;
    bool primary_ = false;
};

std::optional<double> number_in(const Json& object, const char* name) {
    const auto found = object.find(name);
    if (found == object.end()) return {};
    if (found->is_string()) return number(found->get_ref<const std::string&>());
    if (!found->is_number()) return {};
    return found->get<double>();
}

void add_json(const Json& contour, Choice& choice) {
    if (!contour.is_object()) return;
    const auto primary = contour.find("primary");
    choice.add(number_in(contour, "level"),
               primary != contour.end() && (*primary == true || *primary == "true"));
}

std::optional<double> from_json(const Json& record) {
    const Json* node = &record;
    for (const char* name : {"map", "contour_list", "contour"}) {
        const auto next = node->is_object() ? node->find(name) : node->end();
        if (!node->is_object() || next == node->end()) {
            node = nullptr;
            break;
        }
        node = &*next;
    }
    Choice choice;
    if (node && node->is_array())
        for (const Json& contour : *node) add_json(contour, choice);
    else if (node)
        add_json(*node, choice);
    if (!choice.level() && record.is_object()) return number_in(record, "contour");
    return choice.level();
}

/// An element of an XML text: what stands in its start tag behind the name, and what it holds.
struct Element {
    std::string_view attributes, content;
    std::size_t end = 0;  // of the element, in the text
};

/// The next element of this name at or after `from`. Good for what EMDB writes: a name may have a prefix, and
/// an element does not hold another of its name.
std::optional<Element> next_element(std::string_view text, std::string_view name, std::size_t from) {
    for (std::size_t open = text.find('<', from); open != text.npos; open = text.find('<', open + 1)) {
        if (text.substr(open, 4) == "<!--") {
            open = text.find("-->", open);
            if (open == text.npos) return {};
            continue;
        }
        const std::size_t close = text.find('>', open);
        if (close == text.npos) return {};
        std::string_view tag = text.substr(open + 1, close - open - 1);
        std::string_view own = tag.substr(0, std::min(tag.find_first_of(" \t\r\n/"), tag.size()));
        const std::string_view whole = own;
        if (const std::size_t colon = own.find(':'); colon != own.npos) own.remove_prefix(colon + 1);
        if (own != name || tag.empty() || tag.back() == '/') continue;
        const std::size_t end = text.find(fmt::format("</{}", whole), close);
        if (end == text.npos) return {};
        return Element{tag.substr(whole.size()), text.substr(close + 1, end - close - 1), end};
    }
    return {};
}

bool is_primary(std::string_view attributes) {
    const std::size_t name = attributes.find("primary");
    const std::size_t quote = attributes.find_first_of("\"'", std::min(name, attributes.size()));
    if (name == attributes.npos || quote == attributes.npos) return false;
    const std::string_view value = attributes.substr(quote + 1);
    return value.substr(0, 4) == "true" || value.substr(0, 1) == "1";
}

std::optional<double> from_xml(std::string_view text) {
    Choice choice;
    for (auto contour = next_element(text, "contour", 0); contour;
         contour = next_element(text, "contour", contour->end))
        if (const auto level = next_element(contour->content, "level", 0))
            choice.add(number(level->content), is_primary(contour->attributes));
    for (auto level = next_element(text, "contourLevel", 0); level;
         level = next_element(text, "contourLevel", level->end))
        choice.add(number(level->content), false);
    return choice.level();
}

}  // namespace

double recommended_contour(const std::filesystem::path& record) {
    const MappedFile file(record);
    std::string_view text = file.bytes();
    if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
    const std::size_t first = text.find_first_not_of(blanks);
    const char begin = first == text.npos ? '\0' : text[first];
    if (begin != '<' && begin != '{' && begin != '[')
        throw InvalidInput(fmt::format("{}: not a record of the EMDB: neither JSON nor XML", file.name()));
    std::optional<double> level;
    if (begin == '<') {
        level = from_xml(text);
    } else {
        try {
            level = from_json(Json::parse(text));
        } catch (const Json::parse_error& error) {
            throw InvalidInput(fmt::format("{}: byte {}: not a whole JSON record", file.name(), error.byte));
        } catch (const Json::out_of_range&) {
            throw InvalidInput(fmt::format("{}: a number of the JSON record is out of range", file.name()));
        }
    }
    if (!level || !std::isfinite(*level))
        throw InvalidInput(fmt::format("{}: the record holds no recommended contour level", file.name()));
    return *level;
}

}  // namespace vdbgeo
