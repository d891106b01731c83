// Table 2 of Feng, Xia, Tong and Wei 2012 (doi:10.1002/cnm.2532): areas and volumes of spheres.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "tests/support/maps.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/marching_cubes.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

/// The paper does not state its grid. At 0.1 Å marching cubes gives its six figures, to the last digit.
constexpr double spacing = 0.1;

struct Row {
    double square_of_radius, area, volume;  // as printed
};
constexpr Row paper[] = {{1, 12.53, 4.16}, {2, 25.09, 11.81}, {3, 37.66, 21.72}};

MeshMeasures sphere(double radius, double h) {
    const int n = static_cast<int>(std::ceil(2 * radius / h)) + 4;
    const DensityMap map = map_from_function(Vec3i(n, n, n), centred_frame(n, h),
                                             [=](const Vec3d& p) { return radius - p.norm(); });
    return measure_mesh(marching_cubes(map, {0}));
}

}  // namespace

TEST(SphereTable, AreasAndVolumesAreThePapers) {
    std::printf("h = %g A   area: paper    ours  theory   volume: paper    ours  theory\n", spacing);
    for (const Row& row : paper) {
        const double r = std::sqrt(row.square_of_radius);
        const double area = 4 * M_PI * r * r, volume = area * r / 3;
        const MeshMeasures m = sphere(r, spacing);
        std::printf("r = %.4f        %8.2f%8.3f%8.3f        %8.2f%8.3f%8.3f\n", r, row.area, m.area_A2, area,
                    row.volume, m.volume_A3.value(), volume);
        EXPECT_EQ(std::round(100 * m.area_A2), std::round(100 * row.area));
        EXPECT_EQ(std::round(100 * *m.volume_A3), std::round(100 * row.volume));
        // As close to the truth as the paper, whose figures are rounded to 0.01.
        EXPECT_LE(std::abs(m.area_A2 - area), std::abs(row.area - area) + 0.005);
        EXPECT_LE(std::abs(*m.volume_A3 - volume), std::abs(row.volume - volume) + 0.005);
    }
}

TEST(SphereTable, ErrorsFallAtSecondOrder) {
    for (const Row& row : paper) {
        const double r = std::sqrt(row.square_of_radius);
        const double area = 4 * M_PI * r * r, volume = area * r / 3;
        double area_error = 0, volume_error = 0;
        for (const double h : {spacing, spacing / 2, spacing / 4}) {
            const MeshMeasures m = sphere(r, h);
            const double a = std::abs(m.area_A2 - area), v = std::abs(m.volume_A3.value() - volume);
            std::printf("r = %.4f  h = %-5g  area error %.2e", r, h, a);
            if (h < spacing) std::printf(" (order %.2f)", std::log2(area_error / a));
            std::printf("  volume error %.2e", v);
            if (h < spacing) {
                std::printf(" (order %.2f)", std::log2(volume_error / v));
                EXPECT_GE(std::log2(area_error / a), 1.9);
                EXPECT_GE(std::log2(volume_error / v), 1.9);
            }
            std::printf("\n");
            area_error = a;
            volume_error = v;
        }
    }
}
