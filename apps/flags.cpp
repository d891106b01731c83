#include "apps/flags.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "converters/emdb_record.h"

namespace vdbgeo::app {
namespace {

/// "10:90,:,20:" along x, y, z.
Crop parse_crop(const std::string& text) {
    Crop crop;
    const auto fail = [&] {
        return UsageError(fmt::format(
            "--crop: '{}' is not x0:x1,y0:y1,z0:z1 in voxels, where numbers may be left out", text));
    };
    const auto number = [&](const std::string& word) -> std::optional<int> {
        int value = 0;
        if (word.empty()) return {};
        const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        if (error != std::errc() || rest != word.data() + word.size()) throw fail();
        return value;
    };
    std::size_t at = 0;
    for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t colon = text.find(':', at), end = a < 2 ? text.find(',', at) : text.size();
        if (colon == std::string::npos || end == std::string::npos || colon > end) throw fail();
        crop.begin[a] = number(text.substr(at, colon - at));
        crop.end[a] = number(text.substr(colon + 1, end - colon - 1));
        at = end + 1;
    }
    return crop;
}

}  // namespace

std::uint64_t parse_bytes(const char* flag, const std::string& text) {
    double number = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    const std::string unit(rest, static_cast<std::size_t>(text.data() + text.size() - rest));
    const std::string units = "KMGT";
    const bool known = unit.empty() || (units.find(unit[0]) != std::string::npos &&
                                        (unit.size() == 1 || unit == std::string(1, unit[0]) + "B" ||
                                         unit == std::string(1, unit[0]) + "iB"));
    if (error != std::errc() || !known || !(number > 0 && number < 1e15))
        throw UsageError(fmt::format("{}: '{}' is not a size such as 2G or 512M", flag, text));
    const std::size_t power = unit.empty() ? 0 : 10 * (units.find(unit[0]) + 1);
    return static_cast<std::uint64_t>(number * static_cast<double>(std::uint64_t(1) << power));
}

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
    app.add_option("--crop", crop,
                   "Part of the map: x0:x1,y0:y1,z0:z1 in voxels from 0, ends not included [all]");
    app.add_option("--bin", options.bin, "Take the mean of N x N x N voxels as one")->capture_default_str();
    app.add_flag("--invert", options.invert,
                 "Negate the samples: for raw tomograms, where what is dense is dark");
    static const std::map<std::string, MapReadOptions::Normalise> scales{
        {"none", MapReadOptions::Normalise::none},
        {"sigma", MapReadOptions::Normalise::sigma},
        {"range", MapReadOptions::Normalise::range}};
    app.add_option("--normalise", options.normalise,
                   "New units for the densities: sigma (mean 0, rms 1) or range (0 to 1) [none]")
        ->transform(CLI::CheckedTransformer(scales).description(""));
    app.add_option("--grid", options.grid,
                   "Name of the grid in a VDB file [density, else the first of floats]");
}

void MapFlags::add_sparsify(CLI::App& app) {
    app.add_option("--threshold", threshold,
                   "Keep samples above this density, in the map's units, as Nsigma (mean + N rms) or as N% "
                   "(percentile) [keep all]");
    app.add_option("--keep-fraction", keep_fraction,
                   "Keep this part of the samples, the densest, from 0 to 1");
    app.add_option("--band", options.sparsify.band,
                   "Keep samples within this distance of the threshold, in the map's units [no band]");
    app.add_option(
        "--background", options.sparsify.background,
        "Density of what was dropped, in the map's units [the solvent level: median at the border]");
    app.add_option("--mask", options.mask,
                   "Keep samples only where this map or VDB file is above 0 [everywhere]");
    app.add_option("--despeckle", options.despeckle,
                   "Drop connected pieces of fewer voxels than this, after --threshold and --mask [0]");
    app.add_option(
        "--quantise", quantise,
        "Round what is kept to multiples of a power of two up to this, in the map's units or as Nsigma: "
        "smaller files [no]");
    app.add_option("--halo", options.halo,
                   "Keep this many voxels around what is kept, after --despeckle [0]");
}

void MapFlags::add_memory(CLI::App& app) {
    app.add_option("--memory", memory,
                   "Memory that may be taken, such as 2G or 512M [half of the machine's]");
}

void MapFlags::finish() {
    try {
        if (!threshold.empty()) {
            const ThresholdRule rule = ThresholdRule::parse(threshold);
            if (rule.kind == ThresholdRule::Kind::value)
                options.sparsify.threshold = static_cast<float>(rule.number);
            else
                options.threshold = rule;
        }
        if (keep_fraction) {
            if (!threshold.empty()) throw UsageError("--threshold and --keep-fraction both say what is kept");
            options.threshold = ThresholdRule{ThresholdRule::Kind::fraction, *keep_fraction};
        }
        if (!quantise.empty()) options.quantise = ThresholdRule::parse(quantise);
        if (!crop.empty()) options.crop = parse_crop(crop);
        if (!memory.empty()) options.memory = parse_bytes("--memory", memory);
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
    app.add_option(
           "--iso", text,
           "Isovalue: a density in the map's units, Nsigma (mean + N rms), volume:V (encloses V Å³), "
           "mass:M (encloses M Da, or 800kDa), otsu, record:FILE (what the map's EMDB record, JSON or "
           "XML, recommends), or auto (3sigma; 0 for a level set, half the maximum for a fog volume)")
        ->capture_default_str();
}

Isovalue IsoFlag::parse() const {
    const std::string record = "record:";
    if (text.rfind(record, 0) == 0)
        return {Isovalue::Rule::value, recommended_contour(text.substr(record.size()))};
    try {
        return Isovalue::parse(text);
    } catch (const InvalidInput& e) {
        throw UsageError(fmt::format("--iso: {}", e.what()));
    }
}

void refuse_flags(const CLI::App& app, const std::vector<std::string>& names, const std::string& why) {
    for (const std::string& name : names)
        if (app.get_option(name)->count() > 0) throw UsageError(fmt::format("{}: {}", name, why));
}

bool parse_length(const char* flag, const char* unit, const std::string& text, double& length) {
    if (text.empty()) return false;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, length);
    const std::string suffix(rest, static_cast<std::size_t>(end - rest));
    if (error != std::errc() || !(length > 0) || !std::isfinite(length) ||
        !(suffix.empty() || suffix == "A" || suffix == "Å"))
        throw UsageError(
            fmt::format("{}: '{}' is not a length: give {} (0.8) or Å (1.5A)", flag, text, unit));
    return !suffix.empty();
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
    app.add_option("--view", options.view,
                   "three, front, side, top, iso, or x,y,z: the direction towards the viewer")
        ->capture_default_str();
    app.add_option("--color-by", options.property,
                   "Property of the vertices or faces to colour by [plain colour]");
    app.add_option("--color-label", options.label,
                   "Text over the colour scale, with its unit [the property in words]");
    app.add_option("--color-map", options.colormap, "sequential, diverging or categorical [by the range]");
    app.add_option("--min", options.range_min,
                   "Value of the first colour, in the property's unit [2nd percentile]");
    app.add_option("--max", options.range_max,
                   "Value of the last colour, in the property's unit [98th percentile]");
    app.add_flag("--edges", options.edges, "Draw the edges of the faces");
    app.add_option("--samples", options.samples, "Rays a pixel: 1, 4, 9 or 16")->capture_default_str();
    app.add_option("--occlusion", options.occlusion_rays, "Rays of ambient occlusion each, 0 to 1024")
        ->capture_default_str();
    app.add_option("--title", options.title, "Text above the picture [none]");
}

}  // namespace vdbgeo::app
