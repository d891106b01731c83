// Shape index, types and histograms over a surface.
#include "vdbgeo/measure/shape_types.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/vertex_areas.h"

using namespace vdbgeo;

namespace {

const double not_a_number = std::numeric_limits<double>::quiet_NaN();

Curvatures curvatures(const std::vector<std::pair<double, double>>& principal) {
    Curvatures c;
    c.resize(principal.size(), false);
    std::fill(c.flags.begin(), c.flags.end(), std::uint8_t{0});
    for (std::size_t v = 0; v < principal.size(); ++v)
        c.set_from_principal(v, principal[v].first, principal[v].second);
    return c;
}

Array<double> array(const std::vector<double>& values) { return {values.begin(), values.end()}; }

}  // namespace

TEST(ShapeTypes, IndexOfTheModelShapes) {
    EXPECT_DOUBLE_EQ(shape_index(2, 2), -1);
    EXPECT_DOUBLE_EQ(shape_index(2, 0), -0.5);
    EXPECT_DOUBLE_EQ(shape_index(2, -2), 0);
    EXPECT_DOUBLE_EQ(shape_index(0, -2), 0.5);
    EXPECT_DOUBLE_EQ(shape_index(-2, -2), 1);
    EXPECT_DOUBLE_EQ(shape_index(0, 0), 0);
    EXPECT_TRUE(std::isnan(shape_index(not_a_number, 1)));
    EXPECT_DOUBLE_EQ(curvedness(0.1, 0.1), 0.1);
    EXPECT_DOUBLE_EQ(curvedness(0.1, 0), 0.1 / std::sqrt(2.0));
}

TEST(ShapeTypes, EightTypesByTheSignsOfKAndH) {
    struct Case {
        double k1, k2;
        SurfaceType type;
    };
    const Case cases[] = {
        {2, 1, SurfaceType::peak},    {2, 0, SurfaceType::ridge},          {2, -1, SurfaceType::saddle_ridge},
        {0, 0, SurfaceType::flat},    {1, -1, SurfaceType::minimal},       {-1, -2, SurfaceType::pit},
        {0, -2, SurfaceType::valley}, {1, -2, SurfaceType::saddle_valley},
    };
    std::set<std::string> names;
    for (const Case& c : cases) {
        EXPECT_EQ(surface_type(c.k1, c.k2, 0), c.type) << c.k1 << " " << c.k2;
        // The same within a tolerance that is small beside the values.
        const double off = 0.005;
        EXPECT_EQ(surface_type(c.k1 + off, c.k2 - off, 0.02), c.type) << c.k1 << " " << c.k2;
        EXPECT_EQ(surface_type(c.k1 * 1e-3, c.k2 * 1e-3, 0.02), SurfaceType::flat);
        names.insert(name_of(c.type));
    }
    EXPECT_EQ(names.size(), surface_type_count);
    EXPECT_STREQ(name_of(SurfaceType::saddle_ridge), "saddle ridge");
    // H of half the tolerance still counts as 0.
    EXPECT_EQ(surface_type(1.019, -1, 0.02), SurfaceType::minimal);
    EXPECT_EQ(surface_type(1.021, -1, 0.02), SurfaceType::saddle_ridge);
}

TEST(ShapeTypes, AreasOfATorus) {
    const double ring = 25, tube = 10;
    const TriMesh mesh = test::torus_mesh(ring, tube, 400, 200);
    Curvatures c;
    c.resize(mesh.points.size(), false);
    std::fill(c.flags.begin(), c.flags.end(), std::uint8_t{0});
    for (std::size_t v = 0; v < c.size(); ++v) {
        const double far = double(mesh.points[v].head<2>().norm());
        c.set_from_principal(v, 1 / tube, (far - ring) / tube / far);
    }
    const Array<double> areas = vertex_areas(mesh);
    const auto by_type = area_by_type(c, areas, 0);
    const double outer = 2 * M_PI * tube * (M_PI * ring + 2 * tube);
    const double inner = 2 * M_PI * tube * (M_PI * ring - 2 * tube);
    EXPECT_NEAR(by_type[std::size_t(SurfaceType::peak)], outer, 0.02 * outer);
    EXPECT_NEAR(by_type[std::size_t(SurfaceType::saddle_ridge)], inner, 0.02 * inner);
    double sum = 0, total = 0;
    for (const double a : by_type) sum += a;
    for (const double a : areas) total += a;
    EXPECT_NEAR(sum, total, 1e-9 * total);
    EXPECT_NEAR(total, 4 * M_PI * M_PI * ring * tube, 1e-3 * total);
    // With the default tolerance the top and the bottom are ridges.
    const double flatness = default_flatness(c, areas);
    EXPECT_GT(area_by_type(c, areas, flatness)[std::size_t(SurfaceType::ridge)], 0.1 * total);
    c.set_undefined(0);
    sum = 0;
    for (const double a : area_by_type(c, areas, 0)) sum += a;
    EXPECT_NEAR(sum, total - areas[0], 1e-9 * total);
}

TEST(ShapeTypes, DefaultFlatnessIsAShareOfTheMedianByArea) {
    const Curvatures c = curvatures({{0.1, 0.1}, {1, 1}, {7, 7}, {not_a_number, not_a_number}});
    EXPECT_DOUBLE_EQ(default_flatness(c, array({1, 3, 1, 100})), 0.2);
    EXPECT_DOUBLE_EQ(default_flatness(c, array({9, 3, 1, 0})), 0.02);
    EXPECT_EQ(default_flatness(c, array({0, 0, 0, 5})), 0);
    EXPECT_THROW(default_flatness(c, array({1})), InvalidInput);
    EXPECT_THROW(area_by_type(c, array({1, 1, 1, 1}), -1), InvalidInput);
    EXPECT_THROW(area_by_type(c, array({1, 1, 1, 1}), not_a_number), InvalidInput);
}

// Areas that are whole numbers are as many values.
TEST(AreaHistogram, IsThatOfRepeatedValues) {
    std::mt19937 random(5);
    Array<double> values, areas;
    std::vector<double> repeated;
    for (int i = 0; i < 5000; ++i) {
        values.push_back(double(random() % 1000) / 10 - 30);
        areas.push_back(double(random() % 7));
        if (i % 50 == 0) values.back() = not_a_number;
        if (i % 70 == 0) values.back() = std::numeric_limits<double>::infinity();
        if (std::isfinite(values.back()))
            repeated.insert(repeated.end(), std::size_t(areas.back()), values.back());
    }
    std::sort(repeated.begin(), repeated.end());
    const auto at = [&](double part) {
        return repeated[std::size_t(std::ceil(part * double(repeated.size()))) - 1];
    };
    const AreaHistogram h = area_histogram(values, areas, 12);
    EXPECT_EQ(h.p05, at(0.05));
    EXPECT_EQ(h.median, at(0.5));
    EXPECT_EQ(h.p95, at(0.95));
    EXPECT_EQ(h.low, at(0.005));
    EXPECT_EQ(h.high, at(0.995));
    double mean = 0, square = 0;
    std::vector<double> bins(12, 0);
    for (const double v : repeated) {
        mean += v / double(repeated.size());
        bins[std::size_t(std::clamp((v - h.low) / (h.high - h.low) * 12, 0.0, 11.0))] += 1;
    }
    for (const double v : repeated) square += (v - mean) * (v - mean) / double(repeated.size());
    EXPECT_NEAR(h.mean, mean, 1e-9);
    EXPECT_NEAR(h.rms, std::sqrt(square), 1e-9);
    EXPECT_EQ(h.area, bins);
}

TEST(AreaHistogram, OfOneValueAndOfNone) {
    const AreaHistogram one = area_histogram(array({4, 4, not_a_number}), array({1, 2, 5}), 3);
    EXPECT_EQ(one.low, 2);
    EXPECT_EQ(one.high, 6);
    EXPECT_EQ(one.area, (std::vector<double>{0, 3, 0}));
    EXPECT_EQ(one.median, 4);
    EXPECT_EQ(one.rms, 0);
    EXPECT_LT(area_histogram(array({0}), array({1}), 1).low, 0);
    const AreaHistogram none = area_histogram(array({not_a_number}), array({5}), 3);
    EXPECT_EQ(none.area, (std::vector<double>{0, 0, 0}));
    EXPECT_TRUE(std::isnan(none.mean));
    EXPECT_TRUE(std::isnan(none.median));
    EXPECT_THROW(area_histogram(array({1, 2}), array({1}), 3), InvalidInput);
    EXPECT_THROW(area_histogram(array({1}), array({1}), 0), InvalidInput);
    EXPECT_THROW(area_histogram(array({1}), array({-1}), 3), InvalidInput);
    EXPECT_THROW(area_histogram(array({1}), array({not_a_number}), 3), InvalidInput);
}

TEST(VertexAreas, SumToTheAreaWithoutCaps) {
    TriMesh mesh = test::icosphere(3, 10);
    mesh.points.emplace_back(50.f, 0.f, 0.f);  // in no face
    const auto sum = [](const Array<double>& areas) {
        double total = 0;
        for (const double a : areas) total += a;
        return total;
    };
    const double all = sum(vertex_areas(mesh));
    EXPECT_NEAR(all, 400 * M_PI, 0.01 * all);
    EXPECT_EQ(vertex_areas(mesh).back(), 0);
    mesh.face_properties.push_back({cap_property, 1, std::vector<float>(mesh.triangles.size(), 0)});
    std::fill_n(mesh.face_properties[0].values.begin(), mesh.triangles.size() / 20, 1.f);  // one of 20
    EXPECT_NEAR(sum(vertex_areas(mesh)), 0.95 * all, 1e-6 * all);
}
