#include "vdbgeo/view/sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/text.h"

namespace vdbgeo {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// Part of samples that pixel i of `pixels` covers along an axis of `samples`.
struct Cover {
    int first = 0;
    std::vector<double> weights;  ///< of first, first + 1, …; their sum is 1
};

std::vector<Cover> covers(int samples, int pixels) {
    std::vector<Cover> result(index(pixels));
    const double step = static_cast<double>(samples) / pixels;
    for (int i = 0; i < pixels; ++i) {
        const double from = i * step, to = from + step;
        Cover& c = result[index(i)];
        c.first = std::min(samples - 1, static_cast<int>(from));
        const int last = std::clamp(static_cast<int>(std::ceil(to)) - 1, c.first, samples - 1);
        for (int k = c.first; k <= last; ++k)
            c.weights.push_back(std::max(1e-9, std::min(to, k + 1.0) - std::max(from, double(k))));
        double sum = 0;
        for (const double w : c.weights) sum += w;
        for (double& w : c.weights) w /= sum;
    }
    return result;
}

/// First index and number of the samples of a map.
std::pair<openvdb::Coord, Vec3i> box_of(const DensityMap& map) {
    if (map.frame.bounded()) return {openvdb::Coord(0, 0, 0), map.frame.size};
    const auto box = map.grid->evalActiveVoxelBoundingBox();
    if (box.empty()) return {openvdb::Coord(0, 0, 0), Vec3i(1, 1, 1)};
    return {box.min(), Vec3i(box.dim().x(), box.dim().y(), box.dim().z())};
}

constexpr int right_of(int axis) { return axis == 0 ? 1 : 0; }
constexpr int up_of(int axis) { return axis == 2 ? 1 : 2; }

/// Place along an axis of the samples' coordinates: the distance from the origin, where the axes are skewed
/// along the skewed axis.
double place_of(const Frame& frame, int axis, int voxel) {
    const Vec3d step = frame.axes.col(axis);
    return frame.origin[axis] + std::copysign(step.norm(), step[axis]) * voxel;
}

}  // namespace

std::string Section::title() const { return fmt::format("{} = {} of {}", "xyz"[axis], index, count); }

Section take_section(const DensityMap& map, int axis, std::optional<int> wanted) {
    const auto [low, size] = box_of(map);
    const int right = right_of(axis), up = up_of(axis);
    const Vec3d step = map.frame.voxel_size();
    Section s;
    s.axis = axis;
    s.count = size[axis];
    s.index = wanted.value_or(size[axis] / 2);
    if (s.index < 0 || s.index >= s.count)
        throw InvalidInput(
            fmt::format("there is no section {} = {}: the map's are 0 to {}, {:.6g} to {:.6g} \u00c5",
                        "xyz"[axis], s.index, s.count - 1, place_of(map.frame, axis, low[axis]),
                        place_of(map.frame, axis, low[axis] + s.count - 1)));
    s.place = place_of(map.frame, axis, low[axis] + s.index);
    s.width = size[right], s.height = size[up];
    s.step_x = step[right], s.step_y = step[up];
    s.values.reserve(vdbgeo::index(s.width) * vdbgeo::index(s.height));
    const auto accessor = map.grid->getConstAccessor();
    openvdb::Coord at = low;
    at[axis] += s.index;
    for (int y = 0; y < s.height; ++y)
        for (int x = 0; x < s.width; ++x) {
            at[right] = low[right] + x;
            at[up] = low[up] + y;
            s.values.push_back(accessor.getValue(at));
        }
    return s;
}

int voxel_at(const DensityMap& map, int axis, double place_A) {
    const double first = place_of(map.frame, axis, 0), step = place_of(map.frame, axis, 1) - first;
    const double voxel = (place_A - first) / step - box_of(map).first[axis];
    return static_cast<int>(std::lround(std::clamp(voxel, -1e9, 1e9)));
}

Greys greys_of(const std::vector<const Section*>& sections) {
    std::vector<float> all;
    for (const Section* s : sections)
        std::copy_if(s->values.begin(), s->values.end(), std::back_inserter(all),
                     [](float v) { return std::isfinite(v); });
    if (all.empty()) return {};
    const auto part = [&](double p) {
        const auto at = all.begin() + static_cast<std::ptrdiff_t>(p * static_cast<double>(all.size() - 1));
        std::nth_element(all.begin(), at, all.end());
        return double(*at);
    };
    Greys greys{part(0.002), part(0.998)};
    if (!(greys.white > greys.black)) greys.white = greys.black + 1;
    return greys;
}

void draw_section(Image& image, const Section& section, const ColourScale& scale, int left, int top,
                  int width, int height) {
    const auto across = covers(section.width, width), up = covers(section.height, height);
    for (int y = 0; y < height; ++y) {
        const Cover& rows = up[index(height - 1 - y)];
        for (int x = 0; x < width; ++x) {
            const Cover& columns = across[index(x)];
            double mean = 0;
            for (std::size_t r = 0; r < rows.weights.size(); ++r) {
                const float* line = section.values.data() + (index(rows.first) + r) * index(section.width);
                for (std::size_t c = 0; c < columns.weights.size(); ++c)
                    mean += rows.weights[r] * columns.weights[c] * double(line[index(columns.first) + c]);
            }
            image.set(left + x, top + y, scale.colour(mean));
        }
    }
}

Image section_pixels(const Section& section, const Greys& greys) {
    constexpr int least = 300, most = 900;
    // Pixels by voxel, or voxels by pixel, along the side with the finer steps.
    const double step = std::min(section.step_x, section.step_y);
    const double wide = section.width * section.step_x / step, high = section.height * section.step_y / step;
    const double longer = std::max(wide, high);
    const double up = std::min(std::ceil(least / longer), std::floor(most / longer));
    const double factor = up >= 1 ? up : 1 / std::ceil(longer / most);
    const auto pixels = [&](double side) {
        return std::max(1, static_cast<int>(std::lround(factor * side)));
    };
    Image image(pixels(wide), pixels(high));
    draw_section(image, section, {{}, greys.black, greys.white, ""}, 0, 0, image.width, image.height);
    return image;
}

std::vector<Segment> section_contour(const Section& section, double value) {
    std::vector<Segment> pieces;
    for (int y = 0; y + 1 < section.height; ++y)
        for (int x = 0; x + 1 < section.width; ++x) {
            const float* low = section.values.data() + index(y) * index(section.width) + x;
            const float* high = low + section.width;
            // Round the square, from the lower left.
            const std::array<double, 4> v{low[0] - value, low[1] - value, high[1] - value, high[0] - value};
            if (!std::all_of(v.begin(), v.end(), [](double d) { return std::isfinite(d); })) continue;
            const std::array<Vec2d, 4> p{Vec2d(x, y), Vec2d(x + 1, y), Vec2d(x + 1, y + 1), Vec2d(x, y + 1)};
            std::vector<Vec2d> crossings;
            for (std::size_t k = 0; k < 4; ++k) {
                const std::size_t n = (k + 1) % 4;
                if ((v[k] > 0) != (v[n] > 0))
                    crossings.push_back(p[k] + v[k] / (v[k] - v[n]) * (p[n] - p[k]));
            }
            if (crossings.size() == 2) pieces.push_back({crossings[0], crossings[1]});
            if (crossings.size() < 4) continue;
            // Corners 0 and 2 are on one side, and joined where the saddle is on theirs.
            const bool joined = v[0] * v[2] > v[1] * v[3];
            pieces.push_back({crossings[joined ? 0 : 3], crossings[joined ? 1 : 0]});
            pieces.push_back({crossings[joined ? 2 : 1], crossings[joined ? 3 : 2]});
        }
    return pieces;
}

void SectionFigureOptions::check() const {
    if (width < 160 || width > Image::max_side)
        throw InvalidInput(fmt::format("width of {} pixels is not in 160 to {}", width, Image::max_side));
    if (colormap) Colormap{*colormap};
    for (const auto& [name, end] : {std::pair("minimum", range_min), std::pair("maximum", range_max)})
        if (end && !std::isfinite(*end))
            throw InvalidInput(fmt::format("the colour range's {} is not a finite number", name));
    if (range_min && range_max && !(*range_min < *range_max))
        throw InvalidInput(fmt::format("the colour range {} to {} is empty", *range_min, *range_max));
}

namespace {

/// Where things lie in a figure of sections, in pixels.
struct Figure {
    double em, gap, pixels_per_A;
    double name_height, caption_height, row_height, top;
    int height;

    int pixels(double length) const {
        return std::max(1, static_cast<int>(std::lround(pixels_per_A * length)));
    }
};

Figure arrange(const std::vector<SectionRow>& rows, const SectionFigureOptions& options) {
    double across = 0, tallest = 0;
    std::size_t most = 1;
    bool named = false;
    for (const SectionRow& row : rows) {
        double sum = 0;
        for (const Section& s : row.sections) {
            sum += s.width * s.step_x;
            tallest = std::max(tallest, s.height * s.step_y);
        }
        across = std::max(across, sum);
        most = std::max(most, row.sections.size());
        named = named || !row.name.empty();
    }
    Figure f{};
    f.em = std::max(11.0, options.width / 58.0);
    f.gap = 1.2 * f.em;
    f.name_height = named ? 2.0 * f.em : 0.8 * f.em;
    f.caption_height = 3.4 * f.em;
    f.top = (options.title.empty() ? 0.4 : 2.6) * f.em;
    const double room = options.width - 2 * f.em - f.gap * static_cast<double>(most - 1);
    f.pixels_per_A = std::min(room / across, options.width / tallest);
    f.row_height = f.name_height + f.pixels(tallest) + f.caption_height;
    const double high = f.top + f.row_height * static_cast<double>(rows.size()) + (bar_height + 0.6) * f.em;
    if (high > Image::max_side)
        throw InvalidInput(fmt::format("a picture of {} rows of sections would be higher than {} pixels",
                                       rows.size(), Image::max_side));
    f.height = static_cast<int>(std::ceil(high));
    return f;
}

/// The isovalues that are drawn, each once.
std::vector<double> contours_of(const std::vector<SectionRow>& rows) {
    std::vector<double> found;
    for (const SectionRow& row : rows)
        if (row.isovalue && std::find(found.begin(), found.end(), *row.isovalue) == found.end())
            found.push_back(*row.isovalue);
    return found;
}

ColourScale scale_of(const std::vector<SectionRow>& rows, const SectionFigureOptions& options) {
    std::vector<const Section*> all;
    for (const SectionRow& row : rows)
        for (const Section& s : row.sections) all.push_back(&s);
    Greys greys = greys_of(all);
    ColourScale scale;
    if (options.colormap) scale.map = Colormap(*options.colormap);
    if (scale.map && scale.map->diverging()) {  // zero in the middle: what is not given mirrors what is
        const double reach = options.range_max   ? std::abs(*options.range_max)
                             : options.range_min ? std::abs(*options.range_min)
                                                 : std::max(std::abs(greys.black), std::abs(greys.white));
        greys = {-reach, reach};
    }
    scale.low = options.range_min.value_or(greys.black);
    scale.high = options.range_max.value_or(greys.white);
    if (!(scale.high > scale.low)) {  // one given end beyond the data
        const double pad = std::max({std::abs(scale.low), std::abs(scale.high), 1e-30});
        (options.range_min ? scale.high : scale.low) = options.range_min ? scale.low + pad : scale.high - pad;
    }
    scale.label = options.label;
    const std::vector<double> contours = contours_of(rows);
    if (contours.size() == 1) scale.label += fmt::format("; contour at {:.4g}", contours[0]);
    return scale;
}

/// The contour over a section that was drawn at (left, top).
void draw_contour(Image& image, const Section& section, double isovalue, int left, int top, int width,
                  int height, const SectionFigureOptions& options) {
    const double x_scale = static_cast<double>(width) / section.width,
                 y_scale = static_cast<double>(height) / section.height;
    std::vector<Segment> pieces = section_contour(section, isovalue);
    const auto placed = [&](const Vec2d& p) {
        return Vec2d(left + (p.x() + 0.5) * x_scale, top + height - (p.y() + 0.5) * y_scale);
    };
    for (Segment& s : pieces) s = {placed(s.from), placed(s.to)};
    draw_segments(image, pieces, std::max(1.0, options.width / 1000.0), options.contour);
}

void draw_row(Image& image, const Figure& f, double top, const SectionRow& row, const ColourScale& scale,
              const SectionFigureOptions& options) {
    const Vec3f ink = ink_on(options.background);
    double used = f.gap * static_cast<double>(row.sections.size() - 1);
    for (const Section& s : row.sections) used += f.pixels(s.width * s.step_x);
    double x = std::max(f.em, (options.width - used) / 2);
    const int y = static_cast<int>(top + f.name_height);
    draw_text(image, {x, y - 0.55 * f.em}, row.name, fitting(row.name, 1.1 * f.em, options.width - x - f.em),
              ink);
    const double below = top + f.row_height - f.caption_height;
    for (const Section& s : row.sections) {
        const int width = f.pixels(s.width * s.step_x), height = f.pixels(s.height * s.step_y);
        const int left = static_cast<int>(x), upper = static_cast<int>(below) - height;
        draw_section(image, s, scale, left, upper, width, height);
        if (row.isovalue) draw_contour(image, s, *row.isovalue, left, upper, width, height, options);
        const std::string text = fmt::format("{} \u00b7 {:.1f} \u00c5", s.title(), s.place);
        draw_axes(image, {left + 0.5 * f.em, below + 2.7 * f.em}, Vec3d::Unit(right_of(s.axis)),
                  Vec3d::Unit(up_of(s.axis)), "", f.em, ink);
        const double indent = 3.2 * f.em, size = fitting(text, f.em, std::max(f.em, width - indent));
        draw_text(image, {left + indent, below + 2.7 * f.em}, text, std::max(size, 0.6 * f.em), ink);
        x += width + f.gap;
    }
}

}  // namespace

Image draw_section_figure(const std::vector<SectionRow>& rows, const SectionFigureOptions& options) {
    options.check();
    if (rows.empty()) throw InvalidInput("no map is given to take sections of");
    for (const SectionRow& row : rows)
        if (row.sections.empty()) throw InvalidInput("a row of the figure has no sections");
    const Figure f = arrange(rows, options);
    const ColourScale scale = scale_of(rows, options);
    Image image(options.width, f.height, options.background);
    const Vec3f ink = ink_on(options.background);
    const double left = f.em, right = options.width - f.em;
    if (!options.title.empty())
        draw_text(image, {left, 1.9 * f.em}, options.title, fitting(options.title, 1.25 * f.em, right - left),
                  ink);
    double top = f.top;
    for (const SectionRow& row : rows) {
        draw_row(image, f, top, row, scale, options);
        top += f.row_height;
    }
    const double middle = left + 0.42 * (right - left);
    draw_scale_bar(image, {left, right, top, f.em}, std::min(middle - 2 * f.em - left, 0.25 * options.width),
                   f.pixels_per_A, ink);
    const BarStrip bar{middle, right - 1.5 * f.em, top, f.em};
    draw_colour_bar(image, bar, scale, ink);
    for (const double isovalue : contours_of(rows)) {  // marked on the bar
        const double part = (isovalue - scale.low) / (scale.high - scale.low);
        const double x = bar.left + part * (bar.right - bar.left), y = top + 1.8 * f.em;
        if (part >= 0 && part <= 1)
            draw_line(image, {x, y}, {x, y + 1.05 * f.em}, std::max(2.0, 0.14 * f.em), options.contour);
    }
    return image;
}

}  // namespace vdbgeo
