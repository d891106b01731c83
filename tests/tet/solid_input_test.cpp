// Which solids a closed surface bounds, and which surfaces bound none.
#include "vdbgeo/tet/solid_input.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "tests/support/maps.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/surface/label_surfaces.h"
#include "vdbgeo/tet/seed_points.h"
#include "vdbgeo/tet/void_sides.h"

namespace vdbgeo {
namespace {

using test::cube;
using test::flipped;
using test::icosphere;
using test::joined;

std::string refusal(const TriMesh& mesh) {
    try {
        solid_input(mesh, "tetgen");
    } catch (const InvalidInput& e) {
        return e.what();
    } catch (const std::exception& e) {
        return std::string("another error: ") + e.what();
    }
    return "taken";
}

void expect_tells(const std::string& message, const std::string& part) {
    EXPECT_PRED_FORMAT2(testing::IsSubstring, part, message);
}

TriMesh shifted(const TriMesh& mesh, const Vec3d& by) { return test::moved(mesh, Mat3d::Identity(), by); }

TriMesh with_labels(std::vector<std::pair<TriMesh, float>> parts) {
    TriMesh all;
    MeshProperty label{"label", 1, {}};
    for (const auto& [mesh, value] : parts) {
        all = joined(all, mesh);
        label.values.resize(all.triangles.size(), value);
    }
    all.face_properties.push_back(label);
    return all;
}

/// Solid angle of the surface seen from p over 4π (Van Oosterom & Strackee 1983): the winding number.
double winding(const TriMesh& mesh, const Vec3d& p) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.points[t[0]].cast<double>() - p, b = mesh.points[t[1]].cast<double>() - p,
                    c = mesh.points[t[2]].cast<double>() - p;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        sum +=
            2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return sum / (4 * M_PI);
}

void expect_seeds(const TriMesh& surface, const SolidInput& input) {
    for (const SolidInput::Region& r : input.regions) EXPECT_NEAR(winding(surface, r.inside), 1, 1e-6);
    for (const Vec3d& h : input.holes) EXPECT_NEAR(winding(surface, h), 0, 1e-6);
}

TEST(SolidInput, OneShell) {
    const TriMesh ball = icosphere(3, 10);
    const SolidInput input = solid_input(ball, "tetgen");
    ASSERT_EQ(input.regions.size(), 1u);
    EXPECT_EQ(input.regions[0].region, 1);
    EXPECT_NEAR(input.regions[0].volume_A3, 4.0 / 3 * M_PI * 1000, 50);
    EXPECT_LT(input.regions[0].inside.norm(), 5);  // well away from the surface
    EXPECT_TRUE(input.holes.empty());
    ASSERT_EQ(input.points.size(), ball.points.size());
    for (std::size_t i = 0; i < ball.points.size(); ++i)
        EXPECT_EQ(input.points[i], ball.points[i].cast<double>());
    EXPECT_EQ(input.triangles, ball.triangles);
    for (const auto& sides : input.solids)
        EXPECT_EQ(sides, (std::array<std::int32_t, 2>{0, SolidInput::outside}));
}

/// A shell, its cavity, a ball in the cavity with a cavity of its own, and a small ball apart; in any order.
TEST(SolidInput, ShellsAndCavitiesInEachOther) {
    std::vector<TriMesh> pieces{icosphere(4, 50), flipped(icosphere(3, 30)), icosphere(3, 20),
                                flipped(icosphere(2, 10)), shifted(icosphere(1, 4), {60, 0, 0})};
    for (int turn = 0; turn < 5; ++turn) {
        std::rotate(pieces.begin(), pieces.begin() + 1, pieces.end());
        TriMesh all;
        for (const TriMesh& piece : pieces) all = joined(all, piece);
        const SolidInput input = solid_input(all, "tetgen");
        ASSERT_EQ(input.regions.size(), 3u);
        const auto ball = [](double r) { return 4.0 / 3 * M_PI * r * r * r; };
        const double volumes[] = {ball(50) - ball(30), ball(20) - ball(10), ball(4)};
        for (std::size_t r = 0; r < 3; ++r) {
            EXPECT_EQ(input.regions[r].region, int(r) + 1);
            EXPECT_NEAR(input.regions[r].volume_A3 / volumes[r], 1, 0.15);
        }
        EXPECT_TRUE(input.regions[0].inside.norm() > 30 && input.regions[0].inside.norm() < 50);
        EXPECT_TRUE(input.regions[1].inside.norm() > 10 && input.regions[1].inside.norm() < 20);
        ASSERT_EQ(input.holes.size(), 2u);
        for (const Vec3d& h : input.holes)
            EXPECT_TRUE(h.norm() < 10 || (h.norm() > 20 && h.norm() < 30)) << h.transpose();
        expect_seeds(all, input);
    }
}

/// Two cubes that share a face have a mesh of 11 + 11 faces over 12 points.
TEST(SolidInput, SolidsThatTouchShareTheirFaces) {
    const TriMesh both = joined(cube(), cube({1, 0, 0}));
    const SolidInput input = solid_input(both, "tetgen");
    EXPECT_EQ(input.points.size(), 12u);
    EXPECT_EQ(input.triangles.size(), 22u);
    EXPECT_EQ(input.regions.size(), 2u);
    std::size_t shared = 0;
    for (const auto& [behind, before] : input.solids) shared += before != SolidInput::outside;
    EXPECT_EQ(shared, 2u);
    expect_seeds(both, input);
}

/// Solids that touch in a vertex or an edge of the same coordinates.
TEST(SolidInput, SolidsMayTouchInVerticesAndEdges) {
    for (const Vec3f& corner : {Vec3f(1, 1, 0), Vec3f(1, 1, 1)}) {
        const TriMesh both = joined(cube(), cube(corner));
        const SolidInput input = solid_input(both, "tetgen");
        EXPECT_EQ(input.points.size(), corner.z() > 0 ? 15u : 14u);
        EXPECT_EQ(input.triangles.size(), 24u);
        EXPECT_TRUE(input.holes.empty());
        expect_seeds(both, input);
    }
}

/// A box of six slabs that touch along their borders encloses a space that no single piece does.
TEST(SolidInput, ASpaceBetweenSolidsIsAHole) {
    // The unit cells of a 3³ block, but the middle one: 26 cubes, each with a surface of its own.
    TriMesh all;
    for (int i = 0; i < 27; ++i)
        if (i != 13) all = joined(all, cube({float(i % 3), float(i / 3 % 3), float(i / 9)}));
    const SolidInput input = solid_input(all, "tetgen");
    EXPECT_EQ(input.regions.size(), 26u);
    EXPECT_EQ(input.points.size(), 64u);
    ASSERT_EQ(input.holes.size(), 1u);
    EXPECT_LT((input.holes[0] - Vec3d::Constant(1.5)).cwiseAbs().maxCoeff(), 0.5);
}

TEST(SolidInput, LabelsAreRegions) {
    const TriMesh mesh =
        with_labels({{joined(icosphere(3, 30), flipped(icosphere(2, 15))), 7.f}, {icosphere(2, 15), 3.f}});
    const SolidInput input = solid_input(mesh, "tetgen");
    ASSERT_EQ(input.regions.size(), 2u);
    EXPECT_EQ(input.regions[0].region, 3);
    EXPECT_EQ(input.regions[1].region, 7);
    EXPECT_LT(input.regions[0].inside.norm(), 15);
    EXPECT_GT(input.regions[1].inside.norm(), 15);
    EXPECT_TRUE(input.holes.empty());
    EXPECT_EQ(input.triangles.size(), icosphere(3, 30).triangles.size() + icosphere(2, 15).triangles.size());
    expect_seeds(mesh, input);
}

/// A segmentation with a nucleus in a cell in a box, and a bubble.
TEST(SolidInput, SurfacesOfASegmentation) {
    const DensityMap map =
        test::map_from_function(Vec3i::Constant(40), test::centred_frame(40, 1), [](const Vec3d& p) {
            if ((p - Vec3d(11, 0, 0)).norm() < 3) return 0.0;
            if (p.norm() < 7) return 2.0;
            if (p.norm() < 16) return p.z() > 0 ? 1.0 : 4.0;
            return 0.0;
        });
    TriMesh all;
    MeshProperty label{"label", 1, {}};
    double volume = 0;
    for (const LabelSurface& s : label_surfaces(map)) {
        all = joined(all, s.mesh);
        label.values.resize(all.triangles.size(), float(s.label));
    }
    all.face_properties.push_back(label);
    const SolidInput input = solid_input(all, "tetgen");
    ASSERT_EQ(input.regions.size(), 3u);
    EXPECT_EQ(input.holes.size(), 1u);
    for (const auto& r : input.regions) volume += r.volume_A3;
    EXPECT_NEAR(volume / (4.0 / 3 * M_PI * (16 * 16 * 16 - 27)), 1, 0.03);
    expect_seeds(all, input);
}

/// Labels that share vertices by number, as in a file that was welded.
TEST(SolidInput, WeldedLabelsAreTakenToo) {
    TriMesh mesh = test::glued(cube(), cube({1, 0, 0}), {{1, 0}, {3, 2}, {5, 4}, {7, 6}});
    expect_tells(refusal(mesh), "manifold");
    mesh.face_properties.push_back({"label", 1, std::vector<float>(12, 1)});
    mesh.face_properties[0].values.resize(24, 2);
    EXPECT_EQ(solid_input(mesh, "tetgen").triangles.size(), 22u);
}

TEST(SolidInput, RefusesBadSurfacesByName) {
    EXPECT_EQ(refusal({}), "tetgen needs a mesh that is not empty: it has no faces");

    TriMesh nan = icosphere(1, 10);
    nan.points[7].y() = std::numeric_limits<float>::quiet_NaN();
    expect_tells(refusal(nan), "vertex 7");

    TriMesh claims = icosphere(1, 10);
    claims.triangles.back()[2] = 4'000'000'000u;
    expect_tells(refusal(claims), "4000000000");

    TriMesh open = icosphere(1, 10);
    open.triangles.pop_back();
    expect_tells(refusal(open), "the surface is open: 3 boundary edges in 1 hole");

    expect_tells(refusal(test::two_cubes_sharing_an_edge()), "1 edge of three faces or more");
    expect_tells(refusal(test::two_cubes_sharing_a_vertex()), "manifold");

    TriMesh against = icosphere(1, 10);
    std::swap(against.triangles[5][0], against.triangles[5][1]);
    expect_tells(refusal(against), "oriented");

    TriMesh twice = icosphere(1, 10);
    twice.triangles.insert(twice.triangles.end(), twice.triangles.begin(), twice.triangles.end());
    expect_tells(refusal(twice), "of three faces or more");
    expect_tells(refusal(joined(icosphere(1, 10), icosphere(1, 10))), "lie on each other");
}

TEST(SolidInput, RefusesFacesWithoutArea) {
    TriMesh flat = icosphere(1, 10);
    // The middle of an edge becomes a vertex of only one of the two faces, with a face of no area between.
    const Triangle t = flat.triangles[0];
    const auto middle = static_cast<VertexId>(flat.points.size());
    flat.points.emplace_back(0.5f * (flat.points[t[0]] + flat.points[t[0]]));
    flat.triangles[0] = {t[0], middle, t[2]};
    flat.triangles.push_back({middle, t[1], t[2]});
    flat.triangles.push_back({t[0], t[1], middle});
    expect_tells(refusal(flat), "such as face 0");
    expect_tells(refusal(flat), "needs faces with an area: 2 have none");
}

TEST(SolidInput, RefusesWhatIsInsideOut) {
    EXPECT_EQ(refusal(flipped(icosphere(2, 10))),
              "tetgen needs a surface that is turned outward: it is inside out; try repair");
    expect_tells(refusal(joined(icosphere(2, 10), shifted(flipped(icosphere(1, 3)), {20, 0, 0}))),
                 "is inside out");
    // A cavity in a cavity, which is no solid.
    const TriMesh nested =
        joined(joined(icosphere(3, 30), flipped(icosphere(2, 20))), flipped(icosphere(2, 10)));
    expect_tells(refusal(nested), "is inside out");
    expect_tells(refusal(joined(icosphere(3, 30), icosphere(2, 20))), "a solid lies in another one");
}

TEST(SolidInput, RefusesSurfacesThatCutThemselves) {
    if (!have_self_intersections()) GTEST_SKIP() << "this build has no CGAL";
    const std::string message = refusal(joined(icosphere(2, 10), shifted(icosphere(2, 10), {9, 0.1, 0.2})));
    expect_tells(message, "pairs of faces cut or touch each other");
    expect_tells(message, "try repair");
    // A corner that stands on a face.
    expect_tells(refusal(joined(cube({0, 0, 0}, 3), cube({3, 0.7f, 1}))), "cut or touch");
}

TEST(SolidInput, RefusesLabelsThatAreNone) {
    for (const float bad : {0.f, -1.f, 1.5f, std::numeric_limits<float>::quiet_NaN(), 1e9f}) {
        TriMesh mesh = with_labels({{icosphere(1, 10), 1.f}});
        mesh.face_properties[0].values[3] = bad;
        expect_tells(refusal(mesh), "face 3 has the label");
    }
    TriMesh open = with_labels({{icosphere(1, 10), 1.f}});
    open.face_properties[0].values[3] = 2;
    expect_tells(refusal(open), "label 1 needs a mesh that is closed");
}

/// Dust of some hundred units in the last place: starts of rays are rounded off its faces.
TEST(SolidInput, DustFarFromTheOriginIsASolidToo) {
    TriMesh all;
    for (int i = 0; i < 300; ++i) {
        const Mat3d turn = Eigen::AngleAxisd(0.1 * i, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
        all = joined(all, test::moved(icosphere(1, 1e-3 + 1e-5 * i), turn, {140 + 0.1 * i, 146, 118}));
    }
    const SolidInput input = solid_input(all, "tetgen");
    EXPECT_EQ(input.regions.size(), 300u);
    expect_seeds(all, input);
}

/// A tetrahedron with corners a unit in the last place beside a plane, as maps have among their dust.
TEST(SolidInput, RefusesPiecesWithoutAPointInside) {
    const TriMesh flake = test::mesh_of({{139.356247f, 146.058289f, 117.744034f},
                                         {139.365158f, 146.05838f, 117.744049f},
                                         {139.365173f, 146.056793f, 117.752037f},
                                         {139.356232f, 146.056702f, 117.752022f}},
                                        {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}});
    expect_tells(refusal(joined(icosphere(2, 300), shifted(flake, {600, 0, 0}))),
                 "too thin to tell its inside from its outside");
    expect_tells(refusal(flake), "too thin to tell its inside from its outside");
}

TEST(SolidInput, IsCancelled) {
    EXPECT_THROW(solid_input(icosphere(3, 10), "tetgen", Progress([](double) { return false; })), Cancelled);
}

TEST(SeedPoints, SpacesThatAreTooThinHaveNone) {
    // The two sheets have no float between them.
    TriMesh thin = cube();
    for (Vec3f& p : thin.points) p.x() = p.x() == 0 ? 1.f : std::nextafter(1.f, 2.f);
    const auto seeds = seed_points(thin, {{0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22}});
    ASSERT_EQ(seeds.size(), 1u);
    EXPECT_TRUE(seeds[0].empty());
}

}  // namespace
}  // namespace vdbgeo
