#include "apps/preview.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/plot.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/view/text.h"

namespace vdbgeo::app {
namespace {

constexpr int widest = 1280, narrowest = 760, gap = 16, heading = 30;
constexpr double em = 17;
const Vec3f ink = Vec3f::Constant(0.13f);

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

void paste(const Image& from, Image& to, int left, int top) {
    for (int y = 0; y < from.height; ++y) std::copy_n(from.at(0, y), 3 * from.width, to.at(left, top + y));
}

/// First index and number of the samples of a map.
std::pair<openvdb::Coord, Vec3i> box_of(const DensityMap& map) {
    if (map.frame.bounded()) return {openvdb::Coord(0, 0, 0), map.frame.size};
    const auto box = map.grid->evalActiveVoxelBoundingBox();
    if (box.empty()) return {openvdb::Coord(0, 0, 0), Vec3i(1, 1, 1)};
    return {box.min(), Vec3i(box.dim().x(), box.dim().y(), box.dim().z())};
}

}  // namespace

Preview::Section Preview::take_section(const DensityMap& map, int across) {
    const auto [low, size] = box_of(map);
    const int right = across == 0 ? 1 : 0, up = across == 2 ? 1 : 2, middle = size[across] / 2;
    const Vec3d step = map.frame.voxel_size();
    Section s{fmt::format("{} = {} of {}", "xyz"[across], middle, size[across]),
              size[right],
              size[up],
              step[right],
              step[up],
              {}};
    s.values.reserve(index(s.width) * index(s.height));
    const auto accessor = map.grid->getConstAccessor();
    openvdb::Coord at = low;
    at[across] += middle;
    for (int y = 0; y < s.height; ++y)
        for (int x = 0; x < s.width; ++x) {
            at[right] = low[right] + x;
            at[up] = low[up] + y;
            s.values.push_back(accessor.getValue(at));
        }
    return s;
}

/// Black and white leave out the lowest and the highest 0.2 % of the sections.
void Preview::set_greys(Row& row) {
    std::vector<float> all;
    for (const Section& s : row.sections)
        std::copy_if(s.values.begin(), s.values.end(), std::back_inserter(all),
                     [](float v) { return std::isfinite(v); });
    if (all.empty()) return;
    const auto part = [&](double p) {
        const auto at = all.begin() + static_cast<std::ptrdiff_t>(p * static_cast<double>(all.size() - 1));
        std::nth_element(all.begin(), at, all.end());
        return double(*at);
    };
    row.black = part(0.002);
    row.white = part(0.998);
    if (!(row.white > row.black)) row.white = row.black + 1;
}

void Preview::add(const std::string& name, const DensityMap& map, Greys greys, const Progress& progress) {
    Row row;
    row.name = name;
    for (int i = 0; i < 3; ++i) row.sections[index(i)] = take_section(map, 2 - i);
    if (greys == Greys::own || rows_.empty()) {
        set_greys(row);
    } else {
        row.black = rows_[0].black;
        row.white = rows_[0].white;
    }
    row.spectrum = power_spectrum(map, {}, progress);
    rows_.push_back(std::move(row));
}

/// Each pixel is the mean of the samples that it covers.
void Preview::draw_section(Image& image, const Row& row, const Section& section, int left, int top, int width,
                           int height) {
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
            const double grey = std::clamp((mean - row.black) / (row.white - row.black), 0.0, 1.0);
            image.set(left + x, top + y, Vec3f::Constant(static_cast<float>(grey)));
        }
    }
}

Drawing Preview::plot_spectra(const Theme& theme, int width, int height) const {
    const Colormap colours("categorical");
    std::vector<Curve> curves;
    for (std::size_t i = 0; i < rows_.size(); ++i)
        curves.push_back(
            {rows_[i].name, rows_[i].spectrum.frequency, rows_[i].spectrum.power,
             i == 0 ? Vec3f::Constant(0.55f) : colours.category(static_cast<std::int64_t>(i - 1))});
    PlotOptions options;
    options.width = width;
    options.height = height;
    options.theme = theme;
    options.title = "Radial power spectrum";
    options.x_label = "spatial frequency (1/Å)";
    options.y_label = "power (the map's units squared)";
    return plot_curves(curves, true, options);
}

Image Preview::draw_spectra(int width) const { return rasterise(plot_spectra(Theme::light(), width, 460)); }

Image Preview::draw() const {
    // One scale: the rows fill the width, unless that makes them too high.
    double across = 0, tallest = 0;
    for (const Row& row : rows_) {
        double sum = 0;
        for (const Section& s : row.sections) {
            sum += s.width * s.step_x;
            tallest = std::max(tallest, s.height * s.step_y);
        }
        across = std::max(across, sum);
    }
    const double most = rows_.size() > 2 ? 300 : 440;
    const double scale = std::min((widest - 4 * gap) / across, most / tallest);
    const auto pixels = [&](double length) {
        return std::max(1, static_cast<int>(std::lround(scale * length)));
    };
    const int row_height = pixels(tallest) + 2 * heading;
    const int picture_width = std::clamp(pixels(across) + 4 * gap, narrowest, widest);
    const Image spectra = draw_spectra(picture_width - 2 * gap);
    Image image(picture_width, static_cast<int>(rows_.size()) * row_height + spectra.height + 2 * gap);
    int top = gap;
    for (const Row& row : rows_) {
        draw_text(image, {static_cast<double>(gap), top + 0.7 * heading}, row.name, 1.15 * em, ink);
        int left = gap;
        for (const Section& s : row.sections) {
            const int width = pixels(s.width * s.step_x), height = pixels(s.height * s.step_y);
            draw_section(image, row, s, left, top + heading, width, height);
            draw_text(image, {left + 0.5 * width, top + heading + height + 0.65 * heading}, s.title,
                      0.85 * em, ink, TextAlign::centre);
            left += width + gap;
        }
        top += row_height;
    }
    paste(spectra, image, gap, top);
    return image;
}

void Preview::write(const std::string& path) const { write_png(draw(), path); }

}  // namespace vdbgeo::app
