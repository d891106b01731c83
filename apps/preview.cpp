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

}  // namespace

void Preview::add(const std::string& name, const DensityMap& map, Greys scale, const Progress& progress) {
    Row row;
    row.name = name;
    for (std::size_t i = 0; i < 3; ++i) row.sections[i] = take_section(map, 2 - static_cast<int>(i));
    row.greys = scale == Greys::own || rows_.empty() ? greys_of_all(row.sections) : rows_[0].greys;
    row.spectrum = power_spectrum(map, {}, progress);
    rows_.push_back(std::move(row));
}

Image Preview::draw_spectra(int width) const {
    const Colormap colours("categorical");
    std::vector<Curve> curves;
    for (std::size_t i = 0; i < rows_.size(); ++i)
        curves.push_back(
            {rows_[i].name, rows_[i].spectrum.frequency, rows_[i].spectrum.power,
             i == 0 ? Vec3f::Constant(0.55f) : colours.category(static_cast<std::int64_t>(i - 1))});
    PlotOptions options;
    options.width = width;
    options.height = 460;
    options.title = "Radial power spectrum";
    options.x_label = "spatial frequency (1/Å)";
    options.y_label = "power";
    return plot_curves(curves, true, options);
}

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
            draw_section(image, s, {{}, row.greys.black, row.greys.white, ""}, left, top + heading, width,
                         height);
            draw_text(image, {left + 0.5 * width, top + heading + height + 0.65 * heading}, s.title(),
                      0.85 * em, ink, TextAlign::centre);
            left += width + gap;
        }
        top += row_height;
    }
    paste(image, spectra, gap, top);
    return image;
}

void Preview::write(const std::string& path) const { write_png(draw(), path); }

}  // namespace vdbgeo::app
