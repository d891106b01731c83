#include "apps/flags.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace vdbgeo::app {
namespace {

/// "2.5" or "2.5,2.5,3".
std::optional<Vec3d> parse_triple(const std::string& text, bool one_is_enough) {
    std::vector<double> numbers;
    const char *at = text.data(), *end = text.data() + text.size();
    while (at < end) {
        double number = 0;
        const auto [rest, error] = std::from_chars(at, end, number);
        if (error != std::errc() || (rest != end && *rest != ',')) return {};
        numbers.push_back(number);
        if (rest != end && rest + 1 == end) return {};  // a comma, and nothing behind it
        at = rest == end ? rest : rest + 1;
    }
    if (numbers.size() == 1 && one_is_enough) return Vec3d::Constant(numbers[0]);
    if (numbers.size() != 3) return {};
    return Vec3d(numbers[0], numbers[1], numbers[2]);
}

}  // namespace

void MapFlags::add_reading(CLI::App& app) {
    app.add_option("--voxel-size", voxel_size, "Voxel size in Å, one number or x,y,z; overrides the header");
    app.add_option("--origin", origin,
                   "World position of the first sample: auto, header, nstart, zero, or x,y,z in Å")
        ->capture_default_str();
    app.add_option("--mode0", mode0, "Bytes of mode 0 maps: auto, signed or unsigned")
        ->check(CLI::IsMember({"auto", "signed", "unsigned"}))
        ->capture_default_str();
    app.add_option("--volume", options.mrc.volume, "Which volume of a stack of volumes, from 0")
        ->capture_default_str();
    app.add_flag("--invert", options.invert,
                 "Negate the samples: for raw tomograms, where what is dense is dark");
    app.add_option("--grid", options.grid,
                   "Name of the grid in a VDB file [density, else the first of floats]");
}

void MapFlags::add_sparsify(CLI::App& app) {
    app.add_option(
        "--threshold", threshold,
        "Keep samples above this density, in the map's units or as Nsigma (mean + N rms) [keep all]");
    app.add_option("--band", options.sparsify.band,
                   "Keep samples within this distance of the threshold, in the map's units [no band]");
    app.add_option(
        "--background", options.sparsify.background,
        "Density of what was dropped, in the map's units [the solvent level: median at the border]");
}

void MapFlags::finish() {
    try {
        if (!threshold.empty()) {
            const Isovalue level = Isovalue::parse(threshold);
            if (level.rule == Isovalue::Rule::automatic)
                throw UsageError("--threshold: a number or Nsigma is needed");
            if (level.rule == Isovalue::Rule::sigma)
                options.threshold_sigma = level.number;
            else
                options.sparsify.threshold = static_cast<float>(level.number);
        }
        if (!voxel_size.empty()) {
            options.mrc.voxel_size_A = parse_triple(voxel_size, true);
            if (!options.mrc.voxel_size_A)
                throw UsageError(
                    fmt::format("--voxel-size: '{}' is not a number of Å, nor three", voxel_size));
        }
        if (mode0 == "signed") options.mrc.mode0 = MrcReadOptions::Mode0::as_signed;
        if (mode0 == "unsigned") options.mrc.mode0 = MrcReadOptions::Mode0::as_unsigned;
        if (origin == "header") {
            options.mrc.origin = OriginRule::header;
        } else if (origin == "nstart") {
            options.mrc.origin = OriginRule::nstart;
        } else if (origin == "zero") {
            options.mrc.origin = OriginRule::zero;
        } else if (origin != "auto") {
            const auto place = parse_triple(origin, false);
            if (!place)
                throw UsageError(
                    fmt::format("--origin: '{}' is none of auto, header, nstart, zero, x,y,z", origin));
            options.mrc.origin = OriginRule::given;
            options.mrc.origin_A = *place;
        }
        options.check();
    } catch (const InvalidInput& e) {
        throw UsageError(e.what());
    }
}

void IsoFlag::add(CLI::App& app) {
    app.add_option("--iso", text,
                   "Isovalue: a density in the map's units, Nsigma (mean + N rms), or auto (3sigma; 0 for a "
                   "level set, half the maximum for a fog volume)")
        ->capture_default_str();
}

Isovalue IsoFlag::parse() const {
    try {
        return Isovalue::parse(text);
    } catch (const InvalidInput& e) {
        throw UsageError(fmt::format("--iso: {}", e.what()));
    }
}

void add_vdb_flags(CLI::App& app, VdbWriteOptions& options) {
    using Compression = VdbWriteOptions::Compression;
    static const std::map<std::string, Compression> names{
        {"blosc", Compression::blosc}, {"zip", Compression::zip}, {"none", Compression::none}};
    app.add_option("--compression", options.compression,
                   "Compression of a VDB file: blosc, zip or none [blosc]")
        ->transform(CLI::CheckedTransformer(names).description(""));
    app.add_flag("--half", options.half, "Store the values of a VDB file as 16-bit floats");
}

void add_render_flags(CLI::App& app, RenderOptions& options) {
    app.add_option("--width", options.width, "Width of the picture in pixels")->capture_default_str();
    app.add_option("--height", options.height, "Height of the picture in pixels [what the views need]");
    app.add_option("--view", options.view, "three, front, side, top or iso")->capture_default_str();
    app.add_option("--color-by", options.property, "Vertex property to colour by [plain colour]");
    app.add_option("--color-label", options.label,
                   "Text under the colour scale, with its unit [the property's name]");
    app.add_option("--color-map", options.colormap, "sequential, diverging or categorical [by the range]");
    app.add_option("--min", options.range_min,
                   "Value of the first colour, in the property's unit [2nd percentile]");
    app.add_option("--max", options.range_max,
                   "Value of the last colour, in the property's unit [98th percentile]");
    app.add_option("--samples", options.samples, "Rays a pixel: 1, 4, 9 or 16")->capture_default_str();
    app.add_option("--occlusion", options.occlusion_rays, "Rays of ambient occlusion each, 0 to 1024")
        ->capture_default_str();
    app.add_option("--title", options.title, "Text above the picture [none]");
}

}  // namespace vdbgeo::app
