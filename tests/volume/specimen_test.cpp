#include "vdbgeo/volume/specimen.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/phantom.h"

using namespace vdbgeo;

namespace {

std::vector<Part> parts_named(const std::string& kind, const std::vector<std::string>& names) {
    std::vector<Part> chosen;
    for (const Part& part : specimen_parts(kind))
        if (std::find(names.begin(), names.end(), part.name) != names.end()) chosen.push_back(part);
    return chosen;
}

/// Points near the surfaces of the parts, where the density varies.
std::vector<Vec3d> points_near(const std::vector<Part>& parts, int count) {
    std::mt19937 random(11);
    std::uniform_int_distribution<std::size_t> choose(0, parts.size() - 1);
    std::uniform_real_distribution<double> offset(-20, 20);
    std::vector<Vec3d> points;
    for (int i = 0; i < count; ++i) {
        const Part& part = parts[choose(random)];
        points.push_back(part.a + Vec3d(offset(random), offset(random), offset(random)));
    }
    return points;
}

Mat3d turn(double degrees, const Vec3d& axis = Vec3d::UnitZ()) {
    return Eigen::AngleAxisd(degrees * EIGEN_PI / 180, axis).toRotationMatrix();
}

/// The largest change of the density under p → matrix p + shift.
double asymmetry(const std::vector<Part>& parts, const std::vector<Vec3d>& points, const Mat3d& matrix,
                 const Vec3d& shift = Vec3d::Zero()) {
    double worst = 0;
    for (const Vec3d& p : points)
        worst = std::max(worst, std::abs(part_density(parts, p) - part_density(parts, matrix * p + shift)));
    return worst;
}

int blobs(const std::vector<Part>& parts) {
    return static_cast<int>(
        std::count_if(parts.begin(), parts.end(), [](const Part& p) { return p.a == p.b; }));
}

}  // namespace

TEST(PartField, ALonePartHasItsSurfaceAtItsRadius) {
    const std::vector<Part> tube = {{"tube", {0, 0, -50}, {0, 0, 50}, 12}};
    EXPECT_NEAR(part_density(tube, {12, 0, 20}), 0.5, 1e-12);
    EXPECT_NEAR(part_density(tube, {0, 0, 62}), 0.5, 1e-12);
    EXPECT_NEAR(part_density(tube, {0, 0, 0}), 0.8, 1e-12);
    EXPECT_EQ(part_density(tube, {0, 12 * 2.21, 0}), 0);
    const std::vector<Part> blob = {{"blob", {5, 6, 7}, {5, 6, 7}, 3}};
    EXPECT_NEAR(part_density(blob, {5, 9, 7}), 0.5, 1e-12);
}

TEST(PartField, RowsAreTheDensityByItsDefinition) {
    for (const PhantomKind& kind : specimen_kinds()) {
        const std::vector<Part> parts = specimen_parts(kind.name);
        const int size = 40;
        // a box that cuts the specimen, off the round numbers
        const double voxel = parts_extent(parts) / 47.3;
        const PartField field(parts, size, voxel);
        std::vector<float> rows(static_cast<std::size_t>(size * size));
        for (int z = 0; z < size; z += 3) {
            field.rows(z, 0, size, rows.data());
            for (int y = 0; y < size; ++y)
                for (int x = 0; x < size; ++x) {
                    const Vec3d p = voxel * (Vec3d(x, y, z) - Vec3d::Constant(19.5));
                    ASSERT_NEAR(rows[static_cast<std::size_t>(y * size + x)], part_density(parts, p), 1e-5)
                        << kind.name << " at " << x << ' ' << y << ' ' << z;
                }
        }
    }
}

TEST(Specimen, CyclicSymmetries) {
    struct Case {
        const char* kind;
        std::vector<std::string> names;
        int fold;
    };
    for (const Case& c : {Case{"baseplate", {"tube", "hub", "wedge", "pin", "fibre"}, 6},
                          Case{"needle-complex", {"base"}, 12}, Case{"virus", {"capsid", "fibre"}, 5},
                          Case{"virus", {"connector", "collar", "appendage"}, 12}, Case{"virus", {"tail"}, 6},
                          Case{"atpase", {"head", "stalk"}, 3}, Case{"atpase", {"ring"}, 10},
                          Case{"clathrin-cage", {"hub", "leg", "terminal"}, 6}}) {
        const std::vector<Part> parts = parts_named(c.kind, c.names);
        const std::vector<Vec3d> points = points_near(parts, 300);
        EXPECT_LT(asymmetry(parts, points, turn(360.0 / c.fold)), 1e-9) << c.kind << ' ' << c.names[0];
        // and no more than that: the test can tell
        EXPECT_GT(asymmetry(parts, points, turn(180.0 / c.fold)), 0.1) << c.kind << ' ' << c.names[0];
    }
}

TEST(Specimen, MicrotubuleIsAHelixWithASeam) {
    const std::vector<Part> parts = specimen_parts("microtubule");
    const double step = 360.0 / 13, rise = 3 * 41.0 / 13;
    std::vector<Vec3d> away, seam;
    for (const Vec3d& p : points_near(parts, 4000)) {
        if (std::abs(p.z()) > 80) continue;  // the ends are not part of the helix
        // protofilament 0 is at 0°, 12 at step: the seam lies between them, and the others at -step · p
        const double degrees = std::atan2(p.y(), p.x()) * 180 / EIGEN_PI,
                     from_first = std::fmod(360 - degrees, 360);
        if (from_first > step && from_first < 10.5 * step) away.push_back(p);
        if (std::abs(degrees - step) < 0.3 * step) seam.push_back(p);
    }
    ASSERT_GT(away.size(), 300u);
    ASSERT_GT(seam.size(), 30u);
    EXPECT_LT(asymmetry(parts, away, turn(-step), {0, 0, rise}), 1e-9);
    EXPECT_LT(asymmetry(parts, away, turn(0), {0, 0, 82}), 1e-9);
    EXPECT_GT(asymmetry(parts, away, turn(0), {0, 0, 41}), 0.1);        // alpha is not beta
    EXPECT_GT(asymmetry(parts, seam, turn(-step), {0, 0, rise}), 0.1);  // the dimers do not match there
    EXPECT_EQ(std::count_if(parts.begin(), parts.end(), [](const Part& p) { return p.radius == 17; }),
              13 * 12);
}

TEST(Specimen, ClathrinHasDihedralSymmetryAndAHand) {
    const std::vector<Part> parts = specimen_parts("clathrin-cage");
    const std::vector<Vec3d> points = points_near(parts, 300);
    EXPECT_LT(asymmetry(parts, points, turn(180, Vec3d::UnitX())), 1e-9);
    EXPECT_GT(asymmetry(parts, points, Vec3d(1, 1, -1).asDiagonal()), 0.1);
    EXPECT_EQ(parts_named("clathrin-cage", {"hub"}).size(), 36u);
    EXPECT_EQ(blobs(parts_named("clathrin-cage", {"terminal"})), 108);
}

TEST(Specimen, VirusHeadHasTheCountsOfPhi29) {
    // 11 pentamers and 30 hexamers: 235 copies of the capsid protein; the twelfth vertex is the connector's
    EXPECT_EQ(blobs(parts_named("virus", {"capsid"})), 235);
    EXPECT_EQ(blobs(parts_named("virus", {"fibre"})), 20);
}

TEST(Specimen, SampledFieldKeepsTheSymmetryOfTheGrid) {
    const int size = 50;
    PhantomOptions o;
    o.size = size;
    o.kind = "baseplate";
    std::vector<float> values(static_cast<std::size_t>(size * size * size));
    Phantom(o).sections(0, size, values.data());
    double worst = 0;
    for (int z = 0; z < size; ++z) {
        const float* section = values.data() + z * size * size;
        for (int i = 0; i < size * size; ++i)
            worst = std::max(worst, std::abs(double(section[i]) - section[size * size - 1 - i]));
    }
    EXPECT_LT(worst, 1e-5);
    const float highest = *std::max_element(values.begin(), values.end());
    EXPECT_GT(highest, 0.9f);
    EXPECT_LE(highest, 1.0f);
}

TEST(Specimen, UnknownKindIsNamed) {
    EXPECT_THROW(specimen_parts("sphere"), InvalidInput);
    EXPECT_EQ(specimen_kinds().size(), 6u);
}
