// Pictures of meshes of known shape.
#include "vdbgeo/view/render.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/property_text.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

/// One bare view: nothing but the surface and the background.
RenderOptions bare(const std::string& view = "front", int width = 300) {
    RenderOptions options;
    options.view = view;
    options.width = width;
    options.height = width;
    options.occlusion_rays = 2;
    options.scale_bar = options.axis_labels = false;
    return options;
}

bool is_background(const Image& image, int x, int y) {
    const std::uint8_t* p = image.at(x, y);
    return p[0] == 255 && p[1] == 255 && p[2] == 255;
}

struct Silhouette {
    double pixels = 0;
    int left = 1 << 20, right = -1, top = 1 << 20, bottom = -1;
    double width() const { return right - left + 1; }
    double height() const { return bottom - top + 1; }
};

Silhouette silhouette(const Image& image) {
    Silhouette s;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            if (!is_background(image, x, y)) {
                ++s.pixels;
                s.left = std::min(s.left, x), s.right = std::max(s.right, x);
                s.top = std::min(s.top, y), s.bottom = std::max(s.bottom, y);
            }
    return s;
}

Vec3f colour_at(const Image& image, int x, int y) {
    return Vec3f(image.at(x, y)[0], image.at(x, y)[1], image.at(x, y)[2]) / 255;
}

double mean_difference(const Image& a, const Image& b) {
    if (a.width != b.width || a.height != b.height) return 1e9;
    double sum = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(int(a.pixels[i]) - int(b.pixels[i]));
    return sum / static_cast<double>(a.pixels.size());
}

/// Without symmetry, so that every wrong turn shows.
TriMesh lopsided() {
    const TriMesh ball = moved(icosphere(3, 6), Mat3d::Identity(), Vec3d(9, 4, 7));
    return joined(
        moved(torus_mesh(10, 3, 48, 24), Eigen::AngleAxisd(0.5, Vec3d(1, 2, 0.5).normalized()).matrix()),
        ball);
}

Mat3d turn(double degrees, const Vec3d& axis) {
    return Eigen::AngleAxisd(degrees * M_PI / 180, axis).matrix();
}

#define NEEDS_EMBREE() \
    if (!can_render()) GTEST_SKIP() << "this build has no ray caster"

}  // namespace

TEST(Render, SaysWhenTheBuildCannot) {
    if (can_render()) GTEST_SKIP() << "this build can";
    EXPECT_THROW(render(icosphere(1, 1)), InvalidInput);
}

TEST(Render, ASphereIsADiscAndTheRestIsBackground) {
    NEEDS_EMBREE();
    RenderOptions options = bare("front", 600);
    options.samples = 1;  // a pixel is either of the surface or not
    const Silhouette s = silhouette(render(icosphere(5, 50), options));
    EXPECT_NEAR(s.width(), s.height(), 2);
    EXPECT_GT(s.width(), 500);
    const double r = (s.width() + s.height()) / 4;
    EXPECT_NEAR(s.pixels / (M_PI * r * r), 1, 0.01);
    EXPECT_GT(s.left, 0);
    EXPECT_LT(s.right, 599);
}

/// Largest difference of brightness (0…1) of two pictures of a ball inside 0.93 of its radius, and of the
/// steps from a pixel to the next along the rows.
std::pair<double, double> shading_difference(const Image& a, const Image& b) {
    const Silhouette s = silhouette(b);
    const double x0 = (s.left + s.right) / 2.0, y0 = (s.top + s.bottom) / 2.0, r = 0.93 * s.width() / 2;
    const auto difference = [&](int x, int y) { return (colour_at(a, x, y) - colour_at(b, x, y)).mean(); };
    double level = 0, step = 0;
    for (int y = s.top; y <= s.bottom; ++y)
        for (int x = s.left; x < s.right; ++x) {
            if (std::max(std::hypot(x - x0, y - y0), std::hypot(x + 1 - x0, y - y0)) > r) continue;
            const double here = difference(x, y);
            level = std::max(level, std::abs(here));
            step = std::max(step, std::abs(difference(x + 1, y) - here));
        }
    return {level, step};
}

/// A ball of triangles between parallels, every second band of them `thin` times as wide as its neighbours.
TriMesh banded_ball(int bands, int columns, double thin) {
    std::vector<double> angles{0.02};
    const double wide = (M_PI - 0.04) / (0.5 * bands * (1 + thin));
    for (int i = 0; i < bands; ++i) angles.push_back(angles.back() + wide * (i % 2 ? thin : 1));
    return ring_mesh(bands + 1, columns, false, [&](int row, int column) {
        const double a = M_PI - angles[static_cast<std::size_t>(row)], b = 2 * M_PI * column / columns;
        return Vec3d(10 * std::sin(a) * std::cos(b), 10 * std::sin(a) * std::sin(b), 10 * std::cos(a));
    });
}

TEST(Render, ACoarseBallIsShadedLikeAFineOne) {
    NEEDS_EMBREE();
    RenderOptions options = bare("front", 500);
    options.outline = false;
    options.occlusion_rays = 6;
    const auto [level, step] =
        shading_difference(render(icosphere(3, 10), options), render(icosphere(6, 10), options));
    EXPECT_LT(level, 0.012);
    EXPECT_LT(step, 0.008);
}

TEST(Render, SkinnyTrianglesDoNotShow) {
    NEEDS_EMBREE();
    RenderOptions options = bare("front", 500);
    options.outline = false;
    options.occlusion_rays = 6;
    const auto [level, step] = shading_difference(render(banded_ball(40, 48, 0.05), options),
                                                  render(banded_ball(200, 240, 1), options));
    EXPECT_LT(level, 0.012);
    EXPECT_LT(step, 0.008);
}

TEST(Render, ATorusFromTheTopHasItsHole) {
    NEEDS_EMBREE();
    RenderOptions options = bare("top", 500);
    options.samples = 1;
    const Image image = render(torus_mesh(30, 10, 256, 64), options);
    const Silhouette s = silhouette(image);
    const double pixel = s.width() / 80;
    EXPECT_NEAR(s.pixels / (M_PI * (1600 - 400) * pixel * pixel), 1, 0.01);
    EXPECT_TRUE(is_background(image, 250, 250));
}

TEST(Render, ViewsShowTheirAxes) {
    NEEDS_EMBREE();
    const Mat3d stretch = Vec3d(4, 2, 1).asDiagonal();
    const TriMesh mesh = moved(icosphere(4, 10), stretch);
    const auto ratio = [&](const char* view) {
        const Silhouette s = silhouette(render(mesh, bare(view)));
        return s.width() / s.height();
    };
    EXPECT_NEAR(ratio("front"), 4, 0.1);
    EXPECT_NEAR(ratio("side"), 2, 0.05);
    EXPECT_NEAR(ratio("top"), 2, 0.05);
    // A ball at the far end of each axis of the picture.
    const auto lies = [&](const char* view, const Vec3d& where) {
        const TriMesh two = joined(icosphere(3, 10), moved(icosphere(2, 2), Mat3d::Identity(), 30 * where));
        const Image image = render(two, bare(view));
        const Silhouette s = silhouette(image);
        double x = 0, y = 0;
        for (int j = 0; j < image.height; ++j)
            for (int i = 0; i < image.width; ++i)
                if (!is_background(image, i, j)) x += i, y += j;
        // The heavy ball is opposite to the light one.
        return Vec2d(0.5 * (s.left + s.right) - x / s.pixels, y / s.pixels - 0.5 * (s.top + s.bottom));
    };
    EXPECT_GT(lies("front", Vec3d::UnitX()).x(), 20);
    EXPECT_GT(lies("front", Vec3d::UnitZ()).y(), 20);
    EXPECT_GT(lies("side", Vec3d::UnitY()).x(), 20);
    EXPECT_GT(lies("side", Vec3d::UnitZ()).y(), 20);
    EXPECT_GT(lies("top", Vec3d::UnitX()).x(), 20);
    EXPECT_GT(lies("top", Vec3d::UnitY()).y(), 20);
}

TEST(Render, ATurnedMeshGivesTheTurnedView) {
    NEEDS_EMBREE();
    const TriMesh mesh = lopsided();
    const Image front = render(mesh, bare("front", 200));
    EXPECT_LT(mean_difference(front, render(moved(mesh, turn(90, Vec3d::UnitZ())), bare("side", 200))), 0.2);
    EXPECT_LT(mean_difference(front, render(moved(mesh, turn(-90, Vec3d::UnitX())), bare("top", 200))), 0.2);
    EXPECT_GT(mean_difference(front, render(mesh, bare("side", 200))), 5);
    EXPECT_GT(mean_difference(front, render(mesh, bare("top", 200))), 5);
}

TEST(Render, SizeAndPlaceDoNotMatter) {
    NEEDS_EMBREE();
    const TriMesh mesh = lopsided();
    const Image image = render(mesh, bare("iso", 200));
    for (const double scale : {1e-8, 1e8})
        EXPECT_LT(mean_difference(image, render(moved(mesh, scale * Mat3d::Identity()), bare("iso", 200))),
                  0.2)
            << scale;
    const TriMesh far = moved(mesh, Mat3d::Identity(), Vec3d(4096, -8192, 2048));
    EXPECT_LT(mean_difference(image, render(far, bare("iso", 200))), 0.5);
}

TEST(Render, TheInsideHasAnotherColour) {
    NEEDS_EMBREE();
    const RenderOptions options = bare("top", 200);
    const TriMesh ball = icosphere(4, 10);
    const Vec3f outside = colour_at(render(ball, options), 95, 95),
                inside = colour_at(render(flipped(ball), options), 95, 95);
    EXPECT_GT(outside.z(), outside.x());  // the plain colour is blue,
    EXPECT_GT(inside.x(), inside.z());    // the inside's ochre
    // From obliquely above an open tube shows both.
    const Image tube = render(open_cylinder_mesh(10, 12), bare("iso", 200));
    int blue = 0, ochre = 0;
    for (int y = 0; y < 200; ++y)
        for (int x = 0; x < 200; ++x) {
            const Vec3f c = colour_at(tube, x, y);
            blue += c.z() > c.x() + 0.05f;
            ochre += c.x() > c.z() + 0.05f;
        }
    EXPECT_GT(blue, 2000);
    EXPECT_GT(ochre, 1000);
}

TEST(Render, ColoursFollowTheProperty) {
    NEEDS_EMBREE();
    TriMesh mesh = icosphere(4, 10);
    MeshProperty x{"x", 1, {}};
    for (const Vec3f& p : mesh.points) x.values.push_back(p.x());
    mesh.vertex_properties.push_back(x);
    RenderOptions options = bare("front", 200);
    options.property = "x";
    const int middle = 80;  // above the bars at the foot
    const auto warmth = [&](const Image& image, int px) {
        const Vec3f c = colour_at(image, px, middle);
        return c.x() - c.z();
    };
    const Image image = render(mesh, options);
    EXPECT_LT(warmth(image, 60), -0.1);  // negative: blue
    EXPECT_NEAR(warmth(image, 100), 0, 0.05);
    EXPECT_GT(warmth(image, 140), 0.1);  // positive: red
    options.range_min = -1000;
    options.range_max = 1000;  // a wide range: all near the middle's white
    EXPECT_NEAR(warmth(render(mesh, options), 140), 0, 0.05);
    mesh.vertex_properties[0].values.assign(mesh.points.size(), std::numeric_limits<float>::quiet_NaN());
    options.range_min = options.range_max = std::nullopt;
    EXPECT_NEAR(warmth(render(mesh, options), 140), 0, 0.05);  // grey
}

TEST(Render, ClassNumbersAreNotMixed) {
    NEEDS_EMBREE();
    TriMesh mesh = icosphere(4, 10);
    MeshProperty type{"type", 1, {}};
    for (const Vec3f& p : mesh.points) type.values.push_back(p.x() < 0 ? 0.0f : 3.0f);
    mesh.vertex_properties.push_back(type);
    RenderOptions options = bare("front", 200);
    options.property = "type";
    options.colormap = "categorical";
    const Image image = render(mesh, options);
    EXPECT_GT(colour_at(image, 60, 80).z(), colour_at(image, 60, 80).x());    // class 0: blue
    EXPECT_GT(colour_at(image, 140, 80).x(), colour_at(image, 140, 80).z());  // class 3: red
}

TEST(Render, FacesHaveOneColourEach) {
    NEEDS_EMBREE();
    // A square of two faces seen from the front.
    TriMesh mesh;
    mesh.points = {{0, 0, 0}, {10, 0, 0}, {10, 0, 10}, {0, 0, 10}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    const float nothing = std::numeric_limits<float>::quiet_NaN();
    mesh.face_properties = {{"q", 1, {-5, 5}}, {"vector", 3, std::vector<float>(6, 1)}};
    RenderOptions options = bare("front", 200);
    options.outline = false;
    const auto below = [](const Image& image) { return colour_at(image, 130, 80); };
    const auto above = [](const Image& image) { return colour_at(image, 70, 30); };
    const Image plain = render(mesh, options);
    options.property = "q";
    const Image coloured = render(mesh, options);
    EXPECT_GT(below(coloured).z(), below(coloured).x() + 0.2f);  // negative: blue
    EXPECT_GT(above(coloured).x(), above(coloured).z() + 0.2f);  // positive: red
    mesh.face_properties[0].values = {nothing, 5};
    const Image half = render(mesh, options);
    EXPECT_LT((below(half) - below(plain)).norm(), 0.01f);  // without a value: the plain colour
    EXPECT_GT((above(half) - above(plain)).norm(), 0.1f);
    // A property of the vertices goes before one of the faces.
    mesh.vertex_properties = {{"q", 1, {5, 5, 5, 5}}};
    options.range_min = -5, options.range_max = 5;
    const Image vertices = render(mesh, options);
    EXPECT_GT(below(vertices).x(), below(vertices).z() + 0.2f);
    options.property = "vector";
    EXPECT_THROW(render(mesh, options), InvalidInput);
    options.property = "none";
    EXPECT_THROW(render(mesh, options), InvalidInput);
}

TEST(Render, EdgesAreThinDarkLines) {
    NEEDS_EMBREE();
    TriMesh mesh;
    mesh.points = {{0, 0, 0}, {10, 0, 0}, {10, 0, 10}, {0, 0, 10}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    RenderOptions options = bare("front", 200);
    options.outline = false;
    const Image plain = render(mesh, options);
    options.edges = true;
    const Image edges = render(mesh, options);
    // What is darker: the four sides and the diagonal, about a pixel wide each.
    const auto darker = [&](const Image& image) {
        double sum = 0;
        for (int y = 0; y < plain.height; ++y)
            for (int x = 0; x < plain.width; ++x)
                sum += colour_at(image, x, y).sum() < 0.85f * colour_at(plain, x, y).sum();
        return sum;
    };
    const Silhouette s = silhouette(plain);
    const double sides = 2 * (s.width() + s.height()), diagonal = std::hypot(s.width(), s.height());
    EXPECT_GT(darker(edges), 0.8 * (0.5 * sides + diagonal));
    EXPECT_LT(darker(edges), 2.5 * (sides + diagonal));
    EXPECT_EQ(colour_at(edges, 130, 80), colour_at(plain, 130, 80));  // far from all edges
    // The diagonal is opposite to corner 1 of the first face and corner 2 of the second.
    mesh.face_properties = {{"hidden_edges", 1, {2, 4}}};
    const Image hidden = render(mesh, options);
    EXPECT_LT(darker(hidden), darker(edges) - 0.6 * diagonal);
    const int middle_x = (s.left + s.right) / 2, middle_y = (s.top + s.bottom) / 2;
    EXPECT_EQ(colour_at(hidden, middle_x, middle_y), colour_at(plain, middle_x, middle_y));
    // Faces far smaller than a pixel show no lines.
    const TriMesh fine = icosphere(6, 10);
    RenderOptions small = bare("front", 64);
    const Image smooth = render(fine, small);
    small.edges = true;
    EXPECT_LT(mean_difference(render(fine, small), smooth), 1);
}

TEST(Render, FromAnyDirection) {
    NEEDS_EMBREE();
    const TriMesh mesh = lopsided();
    const auto seen = [&](const char* view) { return render(mesh, bare(view)); };
    EXPECT_EQ(seen("0,-1,0").pixels, seen("front").pixels);
    EXPECT_EQ(seen("2.5,0,0").pixels, seen("side").pixels);
    EXPECT_EQ(seen("0,0,1e-3").pixels, seen("top").pixels);
    EXPECT_EQ(seen("0.55,-0.75,0.55").pixels, seen("iso").pixels);
    EXPECT_NE(seen("0,1,0").pixels, seen("front").pixels);
    for (const char* view :
         {"1,2", "1,2,3,4", "0,0,0", "1,,2", "1,2,3 ", "nan,0,0", "inf,0,0", ",1,2", "1,2,"}) {
        RenderOptions options;
        options.view = view;
        EXPECT_THROW(options.check(), InvalidInput) << view;
    }
}

TEST(Render, SameBytesForAnyNumberOfThreads) {
    NEEDS_EMBREE();
    RenderOptions options;
    options.width = 320;
    options.title = "threads";
    const TriMesh mesh = torus_mesh(30, 12, 300, 120);
    const auto with = [&](std::size_t threads) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return render(mesh, options).pixels;
    };
    const auto one = with(1);
    EXPECT_TRUE(one == with(2));
    EXPECT_TRUE(one == with(7));
}

TEST(Render, ThreeViewsShareTheScale) {
    NEEDS_EMBREE();
    RenderOptions options = bare("three", 900);
    options.height = std::nullopt;
    options.samples = 1;
    const Image image = render(icosphere(5, 7), options);
    const Silhouette s = silhouette(image);
    EXPECT_NEAR(s.pixels / (3 * M_PI / 4 * s.height() * s.height()), 1, 0.012);
    EXPECT_LT(image.height, 400);
}

TEST(Render, TheScaleBarHasItsLength) {
    NEEDS_EMBREE();
    RenderOptions options = bare("front", 800);
    options.scale_bar = true;
    options.surface = Vec3f(1, 0.2f, 0.2f);
    const Image image = render(icosphere(5, 100), options);
    // The longest run of ink in the lower rows is the bar; the ball's width tells the scale.
    int longest = 0, ball = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0, run = 0, red = 0; x < image.width; ++x) {
            const Vec3f c = colour_at(image, x, y);
            run = c.maxCoeff() < 0.2f && c.maxCoeff() - c.minCoeff() < 0.01f ? run + 1 : 0;
            red += !is_background(image, x, y) && y < 500;
            longest = std::max(longest, run);
            ball = std::max(ball, red);
        }
    EXPECT_NEAR(longest / (ball / 200.0), 50, 1.5);
}

TEST(Render, ZeroAreaFacesAndUnusedPointsDoNoHarm) {
    NEEDS_EMBREE();
    const TriMesh ball = icosphere(3, 10);
    TriMesh worse = ball;
    worse.points.push_back(Vec3f(1e6f, 0, 0));
    worse.triangles.push_back({0, 0, 1});
    worse.triangles.push_back({5, 5, 5});
    EXPECT_LT(mean_difference(render(ball, bare()), render(worse, bare())), 0.02);
    TriMesh flat;  // seen from its edge there is nothing
    flat.points = {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
    flat.triangles = {{0, 1, 2}};
    EXPECT_EQ(silhouette(render(flat, bare("top"))).pixels > 1000, true);
    EXPECT_NO_THROW(render(flat, bare("front")));
    EXPECT_NO_THROW(render(flat));
}

TEST(Render, BadMeshesAreNamed) {
    NEEDS_EMBREE();
    EXPECT_THROW(render(TriMesh()), InvalidInput);
    TriMesh point;
    point.points = {Vec3f(1, 2, 3)};
    point.triangles = {{0, 0, 0}};
    EXPECT_THROW(render(point), InvalidInput);
    TriMesh nan = icosphere(1, 1);
    nan.points[3].y() = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(render(nan), InvalidInput);
    TriMesh mesh = icosphere(1, 1);
    mesh.vertex_properties.push_back({"normal", 3, std::vector<float>(3 * mesh.points.size())});
    RenderOptions options = bare();
    options.property = "normal";
    EXPECT_THROW(render(mesh, options), InvalidInput);
    options.property = "H";
    EXPECT_THROW(render(mesh, options), InvalidInput);
}

TEST(Render, BadOptionsAreNamed) {
    const auto bad = [](const std::function<void(RenderOptions&)>& change) {
        RenderOptions options;
        EXPECT_NO_THROW(options.check());
        change(options);
        EXPECT_THROW(options.check(), InvalidInput);
    };
    bad([](RenderOptions& o) { o.width = 10; });
    bad([](RenderOptions& o) { o.height = Image::max_side + 1; });
    bad([](RenderOptions& o) { o.view = "back"; });
    bad([](RenderOptions& o) { o.colormap = "jet"; });
    bad([](RenderOptions& o) { o.samples = 3; });
    bad([](RenderOptions& o) { o.occlusion_rays = -1; });
    bad([](RenderOptions& o) { o.range_min = std::numeric_limits<double>::infinity(); });
    bad([](RenderOptions& o) { o.range_min = 2, o.range_max = 1; });
    bad([](RenderOptions& o) { o.surface.x() = 2; });
    bad([](RenderOptions& o) { o.zoom = 0; });
    bad([](RenderOptions& o) { o.zoom = std::numeric_limits<double>::quiet_NaN(); });
    bad([](RenderOptions& o) { o.focus = Vec3d(0, std::numeric_limits<double>::infinity(), 0); });
    bad([](RenderOptions& o) { o.columns = 0; });
    bad([](RenderOptions& o) { o.lines_only = true, o.outline = false; });
    bad([](RenderOptions& o) { o.lines_only = true, o.property = "H"; });
    bad([](RenderOptions& o) { o.background.y() = std::numeric_limits<float>::quiet_NaN(); });
}

TEST(Render, TooLittleRoomIsAnError) {
    NEEDS_EMBREE();
    RenderOptions options;
    options.height = 64;
    EXPECT_THROW(render(icosphere(1, 1), options), InvalidInput);
}

TEST(Render, ReportsProgressAndCancels) {
    NEEDS_EMBREE();
    std::atomic<int> reports = 0;
    render(icosphere(2, 1), bare("front", 128), Progress([&](double) { return ++reports, true; }));
    EXPECT_GT(reports, 4);
    EXPECT_THROW(render(icosphere(2, 1), bare(), Progress([](double f) { return f < 0.3; })), Cancelled);
}

TEST(Render, SeveralMeshesHaveOneScale) {
    NEEDS_EMBREE();
    const TriMesh small = icosphere(4, 1),
                  large = moved(icosphere(4, 2), Mat3d::Identity(), Vec3d(100, 0, 0));
    RenderOptions options = bare("front", 600);
    options.samples = 1;
    const Image image = render({{&small, ""}, {&large, ""}}, options);
    // Two discs with a gap between them.
    std::vector<int> widths;
    for (int x = 0, run = 0; x < image.width; ++x) {
        bool any = false;
        for (int y = 0; y < image.height; ++y) any = any || !is_background(image, x, y);
        if (any) ++run;
        if (!any && run > 0) widths.push_back(run);
        if (!any) run = 0;
    }
    ASSERT_EQ(widths.size(), 2u);
    EXPECT_NEAR(widths[1] / static_cast<double>(widths[0]), 2, 0.03);
    EXPECT_GT(widths[0], 150);
    // Six of them in two rows of three, with names above: the names' ink is all that is added.
    const RenderItem item{&small, ""}, named{&small, "name"};
    options.height.reset();
    const Image six = render({item, item, item, item, item, item}, options);
    EXPECT_NEAR(six.height / static_cast<double>(six.width), 2.0 / 3, 0.1);
    options.columns = 6;
    const Image row = render({item, item, item, item, item, item}, options);
    EXPECT_LT(row.height, six.height / 2);
    EXPECT_GT(render({named, named, named, named, named, named}, options).height, row.height);
    EXPECT_THROW(render(std::vector<RenderItem>(), options), InvalidInput);
    const TriMesh empty;
    try {
        render({item, {&empty, "nothing.ply"}}, options);
        FAIL();
    } catch (const InvalidInput& e) {
        EXPECT_EQ(std::string(e.what()).rfind("nothing.ply: ", 0), 0u) << e.what();
    }
}

TEST(Render, MeshesInTheSamePlaceAreInOneFrame) {
    NEEDS_EMBREE();
    // A part that sticks out of one of them does not shift the other.
    const TriMesh ball = icosphere(4, 10),
                  more = joined(ball, moved(icosphere(2, 1), Mat3d::Identity(), Vec3d(0, 0, 10.5)));
    RenderOptions options = bare("front", 400);
    options.samples = 1;
    options.outline = false;
    const Image image = render({{&ball, ""}, {&more, ""}}, options);
    // The widest row of each ball.
    const auto widest = [&](int from, int to) {
        int best = 0, where = 0;
        for (int y = 0; y < image.height; ++y) {
            int count = 0;
            for (int x = from; x < to; ++x) count += !is_background(image, x, y);
            if (count > best) best = count, where = y;
        }
        return std::pair(best, where);
    };
    const auto [a, row_a] = widest(0, 200);
    const auto [b, row_b] = widest(200, 400);
    EXPECT_NEAR(a, b, 1);
    EXPECT_NEAR(row_a, row_b, 3);
}

TEST(Render, SeveralMeshesShareTheirColours) {
    NEEDS_EMBREE();
    const auto square = [](float value, double x) {
        TriMesh mesh;
        mesh.points = {{0, 0, 0}, {10, 0, 0}, {10, 0, 10}, {0, 0, 10}};
        for (Vec3f& p : mesh.points) p.x() += static_cast<float>(x);
        mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
        mesh.vertex_properties = {{"q", 1, std::vector<float>(4, value)}};
        return mesh;
    };
    const TriMesh low = square(0, 0), high = square(8, 500);
    RenderOptions options = bare("front", 400);
    options.property = "q";
    const Image two = render({{&low, ""}, {&high, ""}}, options);
    const Vec3f first = colour_at(two, 100, 170), second = colour_at(two, 300, 170);
    EXPECT_GT(second.sum(), first.sum() + 0.5f);  // dark blue and pale yellow
    TriMesh bare_mesh = low;
    bare_mesh.vertex_properties.clear();
    EXPECT_THROW(render({{&low, "a"}, {&bare_mesh, "b"}}, options), InvalidInput);
}

TEST(Render, ZoomMagnifiesAboutTheFocus) {
    NEEDS_EMBREE();
    RenderOptions options = bare("front", 300);
    options.samples = 1;
    options.outline = false;
    const TriMesh ball = moved(icosphere(5, 10), Mat3d::Identity(), Vec3d(5, 6, 7));
    options.zoom = 0.5;
    const double half = silhouette(render(ball, options)).width();
    options.zoom = 1;
    const double whole = silhouette(render(ball, options)).width();
    EXPECT_NEAR(whole / half, 2, 0.03);
    options.zoom = 4;  // nothing but surface in the view, which has margins
    EXPECT_EQ(silhouette(render(ball, options)).pixels,
              std::pow(silhouette(render(ball, options)).width(), 2));
    options.zoom = 1;
    options.focus = Vec3d(5, 6, 17);  // the upper end of the ball
    const Silhouette lower = silhouette(render(ball, options));
    EXPECT_NEAR(lower.top, 150, 3);
    EXPECT_NEAR((lower.left + lower.right) / 2.0, 149.5, 2);
}

TEST(Render, ATurntableTurnsWhatIsSeen) {
    NEEDS_EMBREE();
    const TriMesh mesh = lopsided();
    const RenderOptions options = bare("front", 160);
    const auto frames = [&](const TriMesh& m, int n, const RenderOptions& o) {
        std::vector<Image> images;
        render_turntable({{&m, ""}}, n, o, [&](int i, const Image& image) {
            EXPECT_EQ(static_cast<std::size_t>(i), images.size());
            images.push_back(image);
        });
        return images;
    };
    const std::vector<Image> film = frames(mesh, 4, options);
    ASSERT_EQ(film.size(), 4u);
    for (const Image& image : film) EXPECT_EQ(std::pair(image.width, image.height), std::pair(160, 160));
    // Each frame is the first of the mesh that was turned, counter-clockwise seen from above.
    for (int k = 1; k < 4; ++k) {
        const TriMesh turned_mesh = moved(mesh, turn(90.0 * k, Vec3d::UnitZ()));
        const double same =
            mean_difference(film[static_cast<std::size_t>(k)], frames(turned_mesh, 4, options)[0]);
        EXPECT_LT(same, 0.3) << k;
        EXPECT_GT(mean_difference(film[static_cast<std::size_t>(k)], film[0]), 3) << k;
    }
    // What looks the same from the four sides needs no more room in a turn than in one picture.
    const TriMesh round = torus_mesh(10, 3, 64, 32);
    EXPECT_LT(mean_difference(frames(round, 4, options)[0], render(round, options)), 0.05);
    EXPECT_LT(mean_difference(frames(round, 4, options)[3], render(round, options)), 0.3);
    EXPECT_THROW(frames(mesh, 0, options), InvalidInput);
    EXPECT_THROW(frames(mesh, 10001, options), InvalidInput);
}

TEST(Render, WordsCanBeReadOnAnyBackground) {
    NEEDS_EMBREE();
    for (const float paper : {0.0f, 0.08f, 0.9f, 1.0f}) {
        RenderOptions options = bare("front", 400);
        options.scale_bar = true;
        options.background = Vec3f::Constant(paper);
        const Image image = render(icosphere(3, 100), options);
        EXPECT_NEAR(colour_at(image, 2, 2).x(), paper, 0.003);
        // The longest run of one colour below the ball that is not the paper is the scale bar.
        int longest = 0;
        float ink = paper;
        for (int y = 330; y < 400; ++y)
            for (int x = 1, run = 0; x < 400; ++x) {
                const Vec3f c = colour_at(image, x, y);
                run = c == colour_at(image, x - 1, y) && std::abs(c.x() - paper) > 0.1f ? run + 1 : 0;
                // Its upper and lower rows are covered in part.
                if (run > longest || (run == longest && std::abs(c.x() - paper) > std::abs(ink - paper)))
                    longest = run, ink = c.x();
            }
        EXPECT_GT(longest, 30);
        EXPECT_GT(std::abs(luminance(Vec3f::Constant(ink)) - luminance(Vec3f::Constant(paper))), 0.5);
    }
}

TEST(Render, ADrawingIsLinesOnPaper) {
    NEEDS_EMBREE();
    RenderOptions options = bare("front", 300);
    options.lines_only = true;
    const Image image = render(icosphere(5, 10), options);
    EXPECT_TRUE(is_background(image, 150, 150));  // inside the ball
    const Silhouette s = silhouette(image);
    EXPECT_LT(s.pixels, 6 * M_PI * s.width());
    EXPECT_GT(s.pixels, 0.8 * M_PI * s.width());
    options.outline = false;
    EXPECT_THROW(render(icosphere(1, 10), options), InvalidInput);
    options.edges = true;
    EXPECT_GT(silhouette(render(icosphere(1, 10), options)).pixels, 500);
}

TEST(Render, KnownPropertiesHaveWordsAndUnits) {
    EXPECT_EQ(property_text("H").label, "mean curvature H (1/Å)");
    EXPECT_EQ(property_text("K").label, "Gaussian curvature K (1/Å²)");
    EXPECT_EQ(property_text("my_own").label, "my_own");
    EXPECT_TRUE(property_text("type").classes);
    EXPECT_FALSE(property_text("k1").classes);
    NEEDS_EMBREE();
    // Classes are not blended, without being told so; with names they have a legend of as many swatches.
    TriMesh mesh = icosphere(4, 10);
    MeshProperty type{"type", 1, {}};
    for (const Vec3f& p : mesh.points) type.values.push_back(p.x() < 0 ? 0.0f : 3.0f);
    mesh.vertex_properties.push_back(type);
    RenderOptions options = bare("front", 400);
    options.property = "type";
    const Image numbers = render(mesh, options);
    EXPECT_GT(colour_at(numbers, 120, 160).z(), colour_at(numbers, 120, 160).x());
    EXPECT_GT(colour_at(numbers, 280, 160).x(), colour_at(numbers, 280, 160).z());
    options.class_names = {{0, "peak"}, {3, "flat"}};
    const Image names = render(mesh, options);
    const Colormap map("categorical");
    const auto swatch = [&](const Image& image, int number) {
        int pixels = 0;
        for (int y = 320; y < 400; ++y)
            for (int x = 0; x < 400; ++x)
                pixels += (colour_at(image, x, y) - map.category(number)).cwiseAbs().maxCoeff() < 0.01f;
        return pixels;
    };
    for (const int number : {0, 3}) EXPECT_GT(swatch(names, number), 30) << number;
    for (const int number : {1, 2}) {
        EXPECT_EQ(swatch(names, number), 0) << number;
        EXPECT_GT(swatch(numbers, number), 30) << number;
    }
}
