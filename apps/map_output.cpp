#include "apps/map_output.h"

#include <fmt/format.h>

#include <cstdlib>

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

}  // namespace vdbgeo::app
