// Sections through maps: the right samples at the right pixels.
#include "vdbgeo/view/sections.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

Frame frame_with(const Vec3d& steps, const Vec3d& origin = Vec3d::Zero()) {
    Frame frame;
    frame.axes = steps.asDiagonal();
    frame.origin = origin;
    return frame;
}

/// x + 10 y + 100 z, in voxels.
DensityMap ramp(const Vec3i& size) {
    return map_from_function(size, {}, [](const Vec3d& p) { return p.x() + 10 * p.y() + 100 * p.z(); });
}

int grey_at(const Image& image, int x, int y) { return image.at(x, y)[1]; }

const float nan_value = std::numeric_limits<float>::quiet_NaN();

}  // namespace

TEST(Sections, HaveTheSamplesOfTheirPlane) {
    const DensityMap map = ramp({5, 4, 3});
    const Section z = take_section(map, 2, 1), y = take_section(map, 1, 3), x = take_section(map, 0);
    EXPECT_EQ(std::pair(z.width, z.height), std::pair(5, 4));
    EXPECT_EQ(std::pair(y.width, y.height), std::pair(5, 3));
    EXPECT_EQ(std::pair(x.width, x.height), std::pair(4, 3));
    const auto at = [](const Section& s, int i, int j) {
        return s.values[static_cast<std::size_t>(j * s.width + i)];
    };
    EXPECT_EQ(at(z, 4, 2), 4 + 20 + 100);
    EXPECT_EQ(at(y, 4, 2), 4 + 30 + 200);
    EXPECT_EQ(at(x, 3, 2), 2 + 30 + 200);  // the middle one of five is number 2
    EXPECT_EQ(z.title(), "z = 1 of 3");
    EXPECT_EQ(x.index, 2);
    EXPECT_THROW(take_section(map, 2, 3), InvalidInput);
    EXPECT_THROW(take_section(map, 0, -1), InvalidInput);
}

TEST(Sections, AreFoundByTheirPlace) {
    const DensityMap map = map_from_function({10, 12, 8}, frame_with({2, 3, 1.5}, {-10, 0, 6}),
                                             [](const Vec3d& p) { return p.z(); });
    EXPECT_EQ(voxel_at(map, 0, -10), 0);
    EXPECT_EQ(voxel_at(map, 0, -5.2), 2);
    EXPECT_EQ(voxel_at(map, 1, 9), 3);
    EXPECT_EQ(voxel_at(map, 2, 6 + 1.5 * 7), 7);
    EXPECT_EQ(voxel_at(map, 2, 600), 396);  // outside, which take_section says
    EXPECT_DOUBLE_EQ(take_section(map, 2, 4).place, 12);
    EXPECT_DOUBLE_EQ(take_section(map, 1, 4).step_y, 1.5);
    EXPECT_DOUBLE_EQ(take_section(map, 0, 4).step_x, 3);
}

TEST(Sections, OfAMapWithoutABoxAreWhereItsVoxelsAre) {
    DensityMap map = ramp({2, 2, 2});
    map.grid = openvdb::FloatGrid::create(0);
    map.grid->tree().setValue({10, 20, 30}, 5);
    map.grid->tree().setValue({13, 24, 35}, 7);
    map.frame = frame_with({1, 1, 1});
    map.frame.size = Vec3i::Zero();
    const Section z = take_section(map, 2, 5);
    EXPECT_EQ(std::pair(z.width, z.height), std::pair(4, 5));
    EXPECT_EQ(z.values.back(), 7);
    EXPECT_EQ(z.place, 35);
    EXPECT_EQ(voxel_at(map, 2, 35), 5);
}

TEST(Sections, GreysLeaveOutTheRarest) {
    Section s;
    s.width = 100, s.height = 10;
    for (int i = 0; i < 1000; ++i) s.values.push_back(static_cast<float>(i));
    s.values[3] = 1e9f;
    s.values[4] = nan_value;
    const Greys greys = greys_of({&s});
    EXPECT_NEAR(greys.black, 1, 1.5);
    EXPECT_NEAR(greys.white, 997, 2.5);
    s.values.assign(1000, 5);
    EXPECT_GT(greys_of({&s}).white, greys_of({&s}).black);
    s.values.assign(1000, nan_value);
    EXPECT_GT(greys_of({&s}).white, greys_of({&s}).black);
}

TEST(Sections, AsPixelsShowEachVoxelAsABlock) {
    const DensityMap map = ramp({64, 40, 3});
    const Section s = take_section(map, 2, 0);
    const Image image = section_pixels(s, {0, 510});
    ASSERT_EQ(std::pair(image.width, image.height), std::pair(320, 200));
    for (const auto& [x, y] : {std::pair(0, 0), std::pair(63, 0), std::pair(20, 39), std::pair(7, 13)})
        for (const int inside : {0, 2, 4})  // y goes up
            EXPECT_EQ(grey_at(image, 5 * x + inside, 199 - (5 * y + inside)), std::lround((x + 10 * y) / 2.0))
                << x << " " << y;
}

TEST(Sections, AsPixelsKeepTheirShape) {
    const auto size_of = [](int width, int height, double step_x, double step_y) {
        Section s;
        s.width = width, s.height = height, s.step_x = step_x, s.step_y = step_y;
        s.values.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 1);
        const Image image = section_pixels(s, {});
        return std::pair(image.width, image.height);
    };
    EXPECT_EQ(size_of(100, 50, 1, 1), std::pair(300, 150));
    EXPECT_EQ(size_of(50, 220, 2, 2), std::pair(100, 440));
    EXPECT_EQ(size_of(900, 3, 1, 1), std::pair(900, 3));
    EXPECT_EQ(size_of(1000, 500, 1, 1), std::pair(500, 250));
    EXPECT_EQ(size_of(4096, 4096, 1, 1), std::pair(819, 819));
    EXPECT_EQ(size_of(100, 100, 2, 1), std::pair(400, 200));
    EXPECT_EQ(size_of(1, 1, 1, 1), std::pair(300, 300));
    for (int n = 1; n < 3000; n += 7) {
        const auto [width, height] = size_of(n, 1, 1, 1);
        EXPECT_TRUE(width >= 300 && width <= 900) << n;
        EXPECT_GE(height, 1);
    }
}

TEST(Sections, NoNumberIsGrey) {
    Section s;
    s.width = s.height = 2;
    s.values = {0, 1, nan_value, std::numeric_limits<float>::infinity()};
    const Image image = section_pixels(s, {0, 1});
    EXPECT_EQ(grey_at(image, 10, 290), 0);
    EXPECT_EQ(grey_at(image, 290, 290), 255);
    EXPECT_EQ(grey_at(image, 10, 10), 153);
    EXPECT_EQ(grey_at(image, 290, 10), 153);
}

TEST(Sections, ContoursLieWhereTheDensityIs) {
    const DensityMap map = map_from_function({41, 41, 3}, centred_frame(41, 1),
                                             [](const Vec3d& p) { return p.head<2>().squaredNorm(); });
    double length = 0;
    for (const Segment& s : section_contour(take_section(map, 2, 1), 150.3)) {
        for (const Vec2d& p : {s.from, s.to}) EXPECT_NEAR((p - Vec2d(20, 20)).norm(), std::sqrt(150.3), 0.03);
        length += (s.to - s.from).norm();
    }
    EXPECT_NEAR(length / (2 * M_PI * std::sqrt(150.3)), 1, 0.01);
    // A chessboard of four: the two pieces do not cross, and lie on the side of the corners they cut off.
    Section four;
    four.width = four.height = 2;
    for (const float middle : {-0.5f, 0.5f}) {
        four.values = {1, -1 + middle, -1 + middle, 1};
        const std::vector<Segment> pieces = section_contour(four, 0);
        ASSERT_EQ(pieces.size(), 2u);
        for (const Segment& s : pieces) {
            const Vec2d m = (s.from + s.to) / 2;
            // Positive in the middle: corners (1, 0) and (0, 1) are cut off.
            EXPECT_EQ((m.x() - 0.5) * (m.y() - 0.5) < 0, middle > 0) << m.transpose();
        }
    }
    four.values = {1, nan_value, -1, 1};
    EXPECT_TRUE(section_contour(four, 0).empty());
    four.values = {1, 1, 1, 1};
    EXPECT_TRUE(section_contour(four, 0).empty());
}

TEST(Sections, AFigureShowsContourAndDensityAtTheirPixels) {
    const DensityMap map = map_from_function({128, 64, 3}, {}, [](const Vec3d& p) { return p.x(); });
    SectionRow row{"", {take_section(map, 2, 1)}, {}};
    SectionFigureOptions options;
    options.width = 800;
    options.range_min = 0, options.range_max = 127;
    const Image plain = draw_section_figure({row}, options);
    row.isovalue = 60.5;
    const Image figure = draw_section_figure({row}, options);
    ASSERT_EQ(figure.pixels.size(), plain.pixels.size());
    // Where the contour is, its two neighbours are the voxels 60 and 61. Below it the bar is marked too.
    int marked = 0;
    for (int y = 0; y < figure.height; ++y) {
        int first = -1, last = -1;
        for (int x = 0; x < figure.width; ++x)
            if (std::memcmp(figure.at(x, y), plain.at(x, y), 3) != 0) {
                if (first < 0) first = x;
                last = x;
            }
        if (first < 0 && marked > 0) break;
        if (first < 0) continue;
        ++marked;
        EXPECT_LE(last - first, 3);
        EXPECT_NEAR(grey_at(plain, first - 2, y), 60 / 127.0 * 255, 3);
        EXPECT_NEAR(grey_at(plain, last + 2, y), 61 / 127.0 * 255, 3);
    }
    EXPECT_GT(marked, 300);  // half as high as wide
    EXPECT_LT(marked, 400);
}

TEST(Sections, AFigureHasARowForEachMapWithTheSameColours) {
    const DensityMap map = ramp({30, 30, 30});
    const SectionRow row{"map", {take_section(map, 2), take_section(map, 1)}, {}};
    SectionFigureOptions options;
    options.width = 400;
    const Image one = draw_section_figure({row}, options), two = draw_section_figure({row, row}, options);
    const double height = two.height - one.height;
    EXPECT_GT(height, 150);
    EXPECT_LT(height, one.height);
    options.background = Vec3f(0, 0, 0);
    EXPECT_EQ(draw_section_figure({row}, options).at(0, 0)[0], 0);
    options.colormap = "diverging";  // zero is its white, in the middle
    options.range_max = 1e6;
    const Image pale = draw_section_figure({row}, options);
    EXPECT_GT(grey_at(pale, 100, 100), 235);
    EXPECT_THROW(draw_section_figure({}, options), InvalidInput);
    EXPECT_THROW(draw_section_figure({SectionRow{}}, options), InvalidInput);
    EXPECT_THROW(draw_section_figure(std::vector<SectionRow>(200, row), options), InvalidInput);
}

TEST(Sections, BadOptionsAreNamed) {
    const auto bad = [](const std::function<void(SectionFigureOptions&)>& change) {
        SectionFigureOptions options;
        EXPECT_NO_THROW(options.check());
        change(options);
        EXPECT_THROW(options.check(), InvalidInput);
    };
    bad([](SectionFigureOptions& o) { o.width = 100; });
    bad([](SectionFigureOptions& o) { o.width = Image::max_side + 1; });
    bad([](SectionFigureOptions& o) { o.colormap = "jet"; });
    bad([](SectionFigureOptions& o) { o.range_min = 1, o.range_max = 1; });
    bad([](SectionFigureOptions& o) { o.range_max = std::numeric_limits<double>::infinity(); });
}
