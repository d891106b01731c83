// Images, PNG files, text, colour maps, ticks and plots.
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <limits>

#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/plot.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/view/text.h"
#include "vdbgeo/view/ticks.h"

using namespace vdbgeo;

namespace {

Image pattern(int width, int height) {
    Image image(width, height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = static_cast<std::uint8_t>(i * i * 31 + i);
    return image;
}

Image decode(const std::filesystem::path& path) {
    png_image header{};
    header.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&header, path.c_str())) return {};
    header.format = PNG_FORMAT_RGB;
    Image image(static_cast<int>(header.width), static_cast<int>(header.height));
    png_image_finish_read(&header, nullptr, image.pixels.data(), 0, nullptr);
    return image;
}

/// Ink in pixels: how much of a white picture black has covered.
double ink(const Image& image) {
    double sum = 0;
    for (const std::uint8_t byte : image.pixels) sum += (255 - byte) / 255.0 / 3;
    return sum;
}

const Vec3f black = Vec3f::Zero();

}  // namespace

TEST(Image, RefusesSidesOutOfRange) {
    EXPECT_THROW(Image(0, 5), InvalidInput);
    EXPECT_THROW(Image(5, -1), InvalidInput);
    EXPECT_THROW(Image(Image::max_side + 1, 5), InvalidInput);
    EXPECT_EQ(Image(3, 2).pixels.size(), 18u);
}

TEST(Image, AFilledRectangleCoversItsArea) {
    Image image(40, 30);
    fill_rectangle(image, 3.25, 4.5, 20.75, 11, black);
    EXPECT_NEAR(ink(image), 17.5 * 6.5, 0.2);
    fill_rectangle(image, -100, 20, 100, 22, black);  // clipped
    EXPECT_NEAR(ink(image), 17.5 * 6.5 + 80, 0.2);
}

TEST(Image, ALineCoversLengthTimesThicknessAndRoundEnds) {
    Image image(100, 100);
    draw_line(image, {20, 30}, {70, 65}, 4, black);
    EXPECT_NEAR(ink(image), 4 * std::hypot(50, 35) + M_PI * 4, 3);
    Image outside(10, 10);
    draw_line(outside, {-50, -50}, {-20, -30}, 4, black);
    EXPECT_EQ(ink(outside), 0);
}

TEST(Image, OverlappingSegmentsPaintOnce) {
    Image once(60, 20), twice(60, 20);
    const Segment s{{5, 10.3}, {55, 10.3}};
    draw_segments(once, {s}, 3, black);
    draw_segments(twice, {s, s}, 3, black);
    EXPECT_EQ(once.pixels, twice.pixels);
}

TEST(Png, GivesThePixelsBack) {
    test::TempFolder folder;
    for (const auto& [w, h] : {std::pair(1, 1), std::pair(7, 3), std::pair(301, 64)}) {
        const Image image = pattern(w, h);
        write_png(image, folder / "a.png");
        const Image back = decode(folder / "a.png");
        EXPECT_EQ(back.width, w);
        EXPECT_EQ(back.height, h);
        EXPECT_EQ(back.pixels, image.pixels);
    }
}

TEST(Png, AFullDeviceAndAMissingFolderAreIoErrors) {
    test::TempFolder folder;
    EXPECT_THROW(write_png(pattern(50, 50), "/dev/full"), IoError);
    EXPECT_THROW(write_png(pattern(50, 50), folder / "none/a.png"), IoError);
}

TEST(Png, AnImageWithoutPixelsIsRefusedAndTheOldFileStays) {
    test::TempFolder folder;
    test::write_bytes(folder / "a.png", "old");
    EXPECT_THROW(write_png(Image(), folder / "a.png"), InvalidInput);
    Image torn(5, 5);
    torn.pixels.pop_back();
    EXPECT_THROW(write_png(torn, folder / "a.png"), InvalidInput);
    EXPECT_EQ(test::read_bytes(folder / "a.png"), "old");
}

TEST(Text, KnowsAsciiAndTheUnits) {
    for (char32_t c = 0x20; c < 0x7F; ++c) EXPECT_TRUE(has_glyph(c)) << static_cast<int>(c);
    const std::u32string units =
        U"\u00c5\u212b\u00b5\u03bc\u00b0\u00b1\u00d7\u00b7\u2212\u2013\u03c3\u03ba\u2070\u00b9"
        U"\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079\u207b";
    for (const char32_t c : units) EXPECT_TRUE(has_glyph(c)) << static_cast<int>(c);
    EXPECT_FALSE(has_glyph(U'\u20ac'));
}

TEST(Text, EveryLetterLooksDifferent) {
    std::vector<Image> seen;
    for (char c = 0x21; c < 0x7F; ++c) {
        Image image(60, 60);
        draw_text(image, {15, 40}, std::string(1, c), 40, black);
        EXPECT_GT(ink(image), 5) << c;
        for (const Image& other : seen) EXPECT_TRUE(image.pixels != other.pixels) << c;
        seen.push_back(image);
    }
}

TEST(Text, StaysInsideItsWidthAndAlignment) {
    const std::string text = "Curvature H (\u00c5\u207b\u00b9)";
    const double width = text_width(text, 30);
    for (const auto& [align, left] :
         {std::pair(TextAlign::left, 200.0), std::pair(TextAlign::centre, 200 - width / 2),
          std::pair(TextAlign::right, 200 - width)}) {
        Image image(800, 60);
        draw_text(image, {200 + 300.0, 40}, text, 30, black, align);
        int first = image.width, last = -1;
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x)
                if (image.at(x, y)[0] < 128) first = std::min(first, x), last = std::max(last, x);
        EXPECT_NEAR(first, left + 300, 3);
        EXPECT_NEAR(last, left + 300 + width, 5);
    }
}

TEST(Text, UpwardsIsTheSameTextTurned) {
    Image level(200, 60), upwards(60, 200);
    draw_text(level, {10, 40}, "nm\u00b2 Ag", 30, black);
    draw_text(upwards, {40, 190}, "nm\u00b2 Ag", 30, black, TextAlign::left, true);
    for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x) EXPECT_NEAR(level.at(x, y)[0], upwards.at(y, 199 - x)[0], 1);
}

TEST(Text, MalformedUtf8IsABoxNotACrash) {
    for (const std::string bad : {"\xff", "\xc3", "\xe2\x82", "\x80", "\xf5\x80\x80\x80", "a\xc3z"})
        EXPECT_GT(text_width(bad, 20), 0) << bad;
    EXPECT_EQ(text_width("\xff", 20), text_width("\u20ac", 20));
}

TEST(Colormap, SequentialRisesInLuminance) {
    const Colormap map("sequential");
    double before = -1;
    for (int i = 0; i <= 1000; ++i) {
        const double y = luminance(map.colour(i / 1000.0));
        EXPECT_GT(y, before) << i;
        before = y;
    }
    EXPECT_GT(before - luminance(map.colour(0)), 0.6);
}

TEST(Colormap, DivergingIsSymmetricAboutALightMiddle) {
    const Colormap map("diverging");
    EXPECT_TRUE(map.diverging());
    const Vec3f middle = map.colour(0.5);
    EXPECT_LT(middle.maxCoeff() - middle.minCoeff(), 0.01f);
    for (int i = 0; i <= 100; ++i) {
        const Vec3f low = map.colour(0.5 - i / 200.0), high = map.colour(0.5 + i / 200.0);
        EXPECT_NEAR(std::cbrt(luminance(low)), std::cbrt(luminance(high)), 0.035) << i;
        if (i > 5) {
            EXPECT_GT(low.z(), low.x());
            EXPECT_GT(high.x(), high.z());
        }
    }
}

TEST(Colormap, CategoricalColoursAreFarApart) {
    const Colormap map("categorical");
    ASSERT_EQ(map.categories(), 8);
    for (int i = 0; i < 8; ++i)
        for (int k = 0; k < i; ++k)
            EXPECT_GT((map.category(i) - map.category(k)).norm(), 0.15f) << i << ' ' << k;
    EXPECT_EQ(map.category(-1), map.category(7));
    EXPECT_EQ(map.colour(1.0), map.category(7));
    EXPECT_EQ(map.colour(0.13), map.category(1));
}

TEST(Colormap, ClampsMarksNanAndRefusesUnknownNames) {
    const Colormap map("sequential");
    EXPECT_EQ(map.colour(-3), map.colour(0));
    EXPECT_EQ(map.colour(7), map.colour(1));
    EXPECT_EQ(map.colour(std::numeric_limits<double>::quiet_NaN()), Vec3f::Constant(0.6f));
    EXPECT_THROW(Colormap("jet"), InvalidInput);
}

TEST(Ticks, AreRoundAndInside) {
    const Ticks t = make_ticks(-0.13, 0.13, 5);
    EXPECT_EQ(t.labels, (std::vector<std::string>{"\u22120.1", "0", "0.1"}));
    EXPECT_EQ(make_ticks(0, 180, 7).labels, (std::vector<std::string>{"0", "50", "100", "150"}));
    EXPECT_EQ(make_ticks(-2e-7, 2e-7, 3).labels,
              (std::vector<std::string>{"\u22122\u00d710\u207b\u2077", "0", "2\u00d710\u207b\u2077"}));
    for (const double scale : {1e-8, 0.37, 1.0, 6.1, 1e8}) {
        const Ticks s = make_ticks(-scale, 2 * scale, 6);
        EXPECT_GE(s.values.size(), 2u);
        EXPECT_LE(s.values.size(), 6u);
        EXPECT_GE(s.values.front(), -scale * 1.000001);
        EXPECT_LE(s.values.back(), 2 * scale * 1.000001);
    }
}

TEST(Ticks, RoundDownGivesOneTwoFive) {
    EXPECT_DOUBLE_EQ(round_down(99.9), 50);
    EXPECT_DOUBLE_EQ(round_down(100), 100);
    EXPECT_DOUBLE_EQ(round_down(4.9), 2);
    EXPECT_DOUBLE_EQ(round_down(0.0019), 0.001);
}

TEST(Plot, BarsHaveTheHeightsOfTheirCounts) {
    const PlotOptions options;
    const Image image = rasterise(plot_histogram({1, 4, 2}, 0, 3, options));
    const auto bar_pixels = [&](int part) {
        std::size_t n = 0;
        const Vec3f& c = options.bars;
        std::vector<int> columns;
        for (int x = 0; x < image.width; ++x)
            for (int y = 0; y < image.height; ++y) {
                const std::uint8_t* p = image.at(x, y);
                if (p[0] == to_byte(c[0]) && p[1] == to_byte(c[1]) && p[2] == to_byte(c[2]))
                    columns.push_back(x);
            }
        const int first = columns.front(), last = columns.back();
        for (const int x : columns) n += (x - first) * 3 / (last - first + 1) == part;
        return static_cast<double>(n);
    };
    EXPECT_NEAR(bar_pixels(1) / bar_pixels(0), 4, 0.1);
    EXPECT_NEAR(bar_pixels(2) / bar_pixels(0), 2, 0.05);
}

TEST(Plot, EmptyCountsAndBadRangesAreErrors) {
    EXPECT_THROW(plot_histogram({}, 0, 1), InvalidInput);
    EXPECT_THROW(plot_histogram({1}, 1, 1), InvalidInput);
    EXPECT_THROW(plot_histogram({1}, 0, std::numeric_limits<double>::infinity()), InvalidInput);
    EXPECT_THROW(plot_histogram({-1}, 0, 1), InvalidInput);
    EXPECT_THROW(plot_histogram({std::nan("")}, 0, 1), InvalidInput);
    PlotOptions small;
    small.width = 10;
    EXPECT_THROW(plot_histogram({1}, 0, 1, small), InvalidInput);
    EXPECT_NO_THROW(plot_histogram({0, 0}, 0, 1));
}

// What a curve paints, column by column: the middle of its pixels.
TEST(Plot, APowerOfTenIsAStraightCurveOnALogarithmicAxis) {
    Curve curve{"decay", {}, {}, {1, 0, 0}};
    for (int i = 0; i <= 50; ++i) {
        curve.x.push_back(0.01 * i);
        curve.y.push_back(std::pow(10.0, -0.1 * i));
    }
    curve.name.clear();  // the legend has its colour too
    const Image image = rasterise(plot_curves({curve}, true));
    std::vector<Vec2d> middles;
    for (int x = 0; x < image.width; ++x) {
        double sum = 0, n = 0;
        for (int y = 0; y < image.height; ++y) {
            const std::uint8_t* p = image.at(x, y);
            if (p[0] < 250 || p[1] > 5 || p[2] > 5) continue;
            sum += y;
            ++n;
        }
        if (n > 0) middles.emplace_back(x, sum / n);
    }
    ASSERT_GT(middles.size(), 500u);
    const Vec2d first = middles[20], last = middles[middles.size() - 20];
    EXPECT_GT(last.y() - first.y(), 200);
    for (std::size_t i = 20; i + 20 < middles.size(); ++i)
        EXPECT_NEAR(
            middles[i].y(),
            first.y() + (middles[i].x() - first.x()) * (last.y() - first.y()) / (last.x() - first.x()), 1.5);
}

TEST(Plot, CurvesWithoutValuesGiveEmptyAxesAndBadOnesAreErrors) {
    const Drawing axes = plot_curves({}, true);
    EXPECT_EQ(plot_curves({{"", {1, 2}, {0, std::nan("")}, {1, 0, 0}}}, true).width, axes.width);
    EXPECT_NO_THROW(plot_curves({{"", {1, 2}, {-1, 1}, {1, 0, 0}}}, false));
    EXPECT_NO_THROW(plot_curves({{"", {0, 0}, {1, 1}, {1, 0, 0}}}, true));
    EXPECT_THROW(plot_curves({{"", {1, 2}, {1}, {1, 0, 0}}}, true), InvalidInput);
    EXPECT_THROW(plot_curves({{"", {-1, 2}, {1, 1}, {1, 0, 0}}}, true), InvalidInput);
    EXPECT_THROW(plot_curves({{"", {std::nan(""), 2}, {1, 1}, {1, 0, 0}}}, true), InvalidInput);
}
