// Every defect by its name, mended; and what is right, not touched.
#include "vdbgeo/remesh/repair.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <numeric>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/remesh/fill_holes.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

RepairResult mended(const TriMesh& mesh, bool fill = true, bool untangle = false) {
    RepairOptions options;
    options.fill_holes = fill;
    options.self_intersections = untangle;
    RepairResult result = repair(mesh, options);
    check(result.mesh, "mended");
    return result;
}

bool good(const TriMesh& mesh) {
    const MeshMeasures m = measure_mesh(mesh);
    return m.closed && m.manifold && m.oriented && m.duplicate_faces == 0 && m.unused_vertices == 0;
}

double volume(const TriMesh& mesh) { return measure_mesh(mesh).volume_A3.value(); }

bool same(const TriMesh& a, const TriMesh& b) { return a.points == b.points && a.triangles == b.triangles; }

/// Every face with points of its own.
TriMesh soup(const TriMesh& mesh) {
    TriMesh parts;
    for (const Triangle& t : mesh.triangles) {
        const VertexId first = VertexId(parts.points.size());
        for (const VertexId v : t) parts.points.push_back(mesh.points[v]);
        parts.triangles.push_back({first, first + 1, first + 2});
    }
    return parts;
}

TriMesh without(TriMesh mesh, const std::vector<std::size_t>& faces) {
    for (auto it = faces.rbegin(); it != faces.rend(); ++it)
        mesh.triangles.erase(mesh.triangles.begin() + std::ptrdiff_t(*it));
    return mesh;
}

/// A tube of radius ½ along a figure of eight whose strands pass each other at twice `gap`.
TriMesh flat_eight(double gap, int around, int around_tube) {
    const auto centre = [&](double u) {
        return Vec3d(3 * std::sin(u), 1.5 * std::sin(2 * u), gap * std::cos(u));
    };
    const TriMesh tube = ring_mesh(around_tube, around, true, [&](int r, int c) {
        const double u = 2 * M_PI * c / around, v = 2 * M_PI * r / around_tube;
        const Vec3d along = (centre(u + 1e-4) - centre(u - 1e-4)).normalized();
        const Vec3d side = along.cross(Vec3d::UnitZ()).normalized();
        return Vec3d(centre(u) + 0.5 * (std::cos(v) * side + std::sin(v) * side.cross(along)));
    });
    return moved(tube, Eigen::AngleAxisd(0.3, Vec3d(1, 2, 3).normalized()).toRotationMatrix());
}

void flip(TriMesh& mesh, std::size_t face) { std::swap(mesh.triangles[face][0], mesh.triangles[face][1]); }

}  // namespace

TEST(Repair, GoodMeshesComeBackAsTheyAre) {
    const TriMesh hollow = joined(cube({0, 0, 0}, 4), flipped(cube({1, 1, 1}, 1)));
    for (const TriMesh& mesh : {TriMesh(), cube(), icosphere(3, 2), torus_mesh(3, 1), hollow,
                                joined(cube(), cube({1, 0, 0}))}) {  // cubes that touch stay apart
        const RepairResult r = mended(mesh);
        EXPECT_TRUE(same(r.mesh, mesh));
        const RepairReport& q = r.report;
        EXPECT_EQ(q.merged_vertices + q.degenerate_faces + q.duplicate_faces + q.flipped_faces +
                      q.flipped_pieces + q.split_vertices + q.filled_holes + q.open_holes + q.added_faces +
                      q.unused_vertices + q.moved_vertices + q.refilled_faces,
                  0u);
    }
}

TEST(Repair, ASecondRepairFindsNothing) {
    TriMesh mesh = joined(soup(icosphere(2, 1)), moved(without(torus_mesh(3, 1, 24, 12), {5, 6, 40}),
                                                       Mat3d::Identity(), Vec3d(9, 0, 0)));
    flip(mesh, 7);
    const TriMesh once = mended(mesh).mesh;
    EXPECT_TRUE(good(once));
    EXPECT_TRUE(same(mended(once).mesh, once));
}

TEST(Repair, ASoupOfTrianglesBecomesASphere) {
    const TriMesh sphere = icosphere(3, 2);
    const RepairResult r = mended(soup(sphere));
    EXPECT_TRUE(good(r.mesh));
    EXPECT_EQ(r.mesh.points.size(), sphere.points.size());
    EXPECT_EQ(r.report.merged_vertices, 3 * sphere.triangles.size() - sphere.points.size());
    EXPECT_EQ(r.report.unused_vertices, 0u);
    EXPECT_EQ(volume(r.mesh), volume(sphere));
}

TEST(Repair, ASoupWithRandomSidesBecomesASphere) {
    TriMesh mesh = soup(icosphere(3, 2));
    for (std::size_t f = 0; f < mesh.triangles.size(); f += 1 + f % 3) flip(mesh, f);
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(good(r.mesh));
    EXPECT_GT(volume(r.mesh), 0);
}

TEST(Repair, ASoupOfCubesThatShareAnEdgeBecomesTwoCubes) {
    const RepairResult r = mended(soup(two_cubes_sharing_an_edge()));
    EXPECT_TRUE(good(r.mesh));
    EXPECT_EQ(mesh_components(r.mesh).components.size(), 2u);
    EXPECT_NEAR(volume(r.mesh), 2, 1e-12);
}

TEST(Repair, AFaceThatNamesAVertexTwice) {
    TriMesh mesh = cube();
    mesh.triangles.insert(mesh.triangles.begin(), Triangle{1, 4, 1});
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(same(r.mesh, cube()));
    EXPECT_EQ(r.report.degenerate_faces, 1u);
}

TEST(Repair, ADuplicateFace) {
    TriMesh mesh = cube();
    mesh.triangles.push_back({3, 0, 2});
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(same(r.mesh, cube()));
    EXPECT_EQ(r.report.duplicate_faces, 1u);
}

TEST(Repair, OppositeFacesCancel) {
    TriMesh mesh = cube();
    mesh.triangles.push_back({0, 1, 6});  // a fin inside, both ways up
    mesh.triangles.push_back({1, 0, 6});
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(same(r.mesh, cube()));
    EXPECT_EQ(r.report.duplicate_faces, 2u);
}

TEST(Repair, OneOfTwoOppositeFacesStaysWhereItClosesTheSurface) {
    TriMesh mesh = cube();
    mesh.triangles.push_back({0, 3, 2});
    const RepairResult r = mended(mesh, false);
    EXPECT_TRUE(same(r.mesh, cube()));
    EXPECT_EQ(r.report.duplicate_faces, 1u);
}

TEST(Repair, AFlippedFace) {
    TriMesh mesh = icosphere(2, 1);
    flip(mesh, 11);
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(good(r.mesh));
    EXPECT_EQ(r.report.flipped_faces, 1u);
    EXPECT_EQ(volume(r.mesh), volume(icosphere(2, 1)));
}

TEST(Repair, AFlippedPiece) {
    const RepairResult r = mended(joined(cube(), flipped(cube({3, 0, 0}))));
    EXPECT_NEAR(volume(r.mesh), 2, 1e-12);
    EXPECT_EQ(r.report.flipped_pieces, 1u);
    EXPECT_EQ(r.report.flipped_faces, 12u);
}

TEST(Repair, ACavityInAFlippedShellStaysACavity) {
    // The shell alone is turned the wrong way; then the shell and its cavity are.
    for (const bool both : {false, true}) {
        const TriMesh inner = cube({1, 1, 1}, 2);
        const TriMesh mesh = joined(flipped(cube({0, 0, 0}, 4)), both ? inner : flipped(inner));
        const RepairResult r = mended(mesh);
        EXPECT_NEAR(volume(r.mesh), 64 - 8, 1e-9);
        EXPECT_EQ(r.report.flipped_pieces, both ? 2u : 1u);
    }
}

TEST(Repair, AnIslandInACavityFacesOutward) {
    TriMesh mesh = joined(cube({0, 0, 0}, 8), flipped(cube({1, 1, 1}, 6)));
    mesh = joined(mesh, flipped(cube({2, 2, 2}, 4)));
    const RepairResult r = mended(mesh);
    EXPECT_NEAR(volume(r.mesh), 512 - 216 + 64, 1e-9);
    EXPECT_EQ(r.report.flipped_faces, 12u);
}

TEST(Repair, ACavityInAnOpenShellStays) {
    // A cube without its side at z = 0 around a hollow cube: open, so it has no volume, but it has an inside.
    const TriMesh mesh = joined(without(cube({0, 0, 0}, 4), {0, 1}), flipped(cube({1, 1, 1}, 1)));
    const RepairResult r = mended(mesh, false);
    EXPECT_TRUE(same(r.mesh, mesh));
    EXPECT_EQ(r.report.open_holes, 1u);
}

TEST(Repair, AMoebiusBandIsRefusedByName) {
    try {
        repair(moebius(30));
        FAIL();
    } catch (const InvalidInput& e) {
        EXPECT_NE(std::string(e.what()).find("Moebius"), std::string::npos);
    }
}

TEST(Repair, CubesThatShareAnEdgeOrAVertex) {
    for (const TriMesh& mesh : {two_cubes_sharing_an_edge(), two_cubes_sharing_a_vertex()}) {
        const RepairResult r = mended(mesh);
        EXPECT_TRUE(good(r.mesh));
        EXPECT_NEAR(volume(r.mesh), 2, 1e-12);
        EXPECT_GT(r.report.split_vertices, 0u);
        EXPECT_EQ(r.report.unused_vertices, mesh.points.size() - 16 + r.report.split_vertices);
    }
}

TEST(Repair, AFinOnACube) {
    // The third face of an edge is cut off, and as a single face it stays open.
    TriMesh mesh = cube();
    mesh.points.push_back(Vec3f(0.5f, -1, -1));
    mesh.triangles.push_back({0, 1, 8});
    const RepairResult r = mended(mesh);
    const MeshMeasures m = measure_mesh(r.mesh);
    EXPECT_TRUE(m.manifold && m.oriented);
    EXPECT_EQ(m.components, 2u);
    EXPECT_EQ(r.report.open_holes, 1u);
}

TEST(Repair, UnusedVerticesGo) {
    TriMesh mesh = cube();
    mesh.points.insert(mesh.points.begin() + 3, Vec3f(9, 9, 9));
    for (Triangle& t : mesh.triangles)
        for (VertexId& v : t) v += v >= 3;
    mesh.vertex_properties.push_back({"v", 1, {0, 1, 2, 99, 3, 4, 5, 6, 7}});
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(same(r.mesh, cube()));
    EXPECT_EQ(r.report.unused_vertices, 1u);
    EXPECT_EQ(r.mesh.vertex_properties[0].values, (std::vector<float>{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST(Repair, HolesAreFilled) {
    TriMesh mesh = without(icosphere(3, 1), {3, 100, 101, 400});
    mesh.face_properties.push_back({cap_property, 1, std::vector<float>(mesh.triangles.size(), 1)});
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(good(r.mesh));
    EXPECT_GE(r.report.filled_holes, 3u);
    EXPECT_EQ(r.report.added_faces, 4u);
    EXPECT_EQ(r.mesh.face_properties[0].values.back(), 0);
    EXPECT_NEAR(volume(r.mesh), volume(icosphere(3, 1)), 1e-3);
}

TEST(Repair, HolesStayOpenWhereAskedToOrTooLong) {
    const TriMesh mesh = without(cube(), {4});
    EXPECT_TRUE(same(mended(mesh, false).mesh, mesh));
    const TriMesh tube = open_cylinder_mesh(1, 2, 4, 12);
    RepairOptions options;
    options.max_hole_edges = 11;
    EXPECT_EQ(repair(tube, options).report.open_holes, 2u);
    options.max_hole_edges = 12;
    EXPECT_EQ(repair(tube, options).report.filled_holes, 2u);
}

TEST(Repair, AFlatSheetHasNoHole) {
    const TriMesh sheet = mesh_of({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}});
    const RepairResult r = mended(sheet);
    EXPECT_TRUE(same(r.mesh, sheet));
    EXPECT_EQ(r.report.open_holes, 1u);
}

TEST(Repair, EverythingAtOnce) {
    TriMesh mesh = joined(without(icosphere(3, 2), {10, 11, 12}),
                          soup(moved(flipped(icosphere(2, 1)), Mat3d::Identity(), Vec3d(9, 0, 0))));
    mesh = joined(mesh, moved(two_cubes_sharing_an_edge(), Mat3d::Identity(), Vec3d(0, 20, 0)));
    flip(mesh, 30);
    mesh.triangles.push_back(mesh.triangles[40]);
    mesh.triangles.push_back({1, 1, 2});
    const RepairResult r = mended(mesh);
    EXPECT_TRUE(good(r.mesh));
    EXPECT_EQ(mesh_components(r.mesh).components.size(), 4u);
    for (const MeshComponent& c : mesh_components(r.mesh).components) EXPECT_FALSE(c.cavity());
}

TEST(Repair, SameBytesForAnyNumberOfThreads) {
    TriMesh mesh = soup(joined(torus_mesh(3, 1), moved(icosphere(4, 1), Mat3d::Identity(), Vec3d(9, 0, 0))));
    mesh = without(mesh, {50, 900, 901, 4000});
    const TriMesh once = mended(mesh).mesh;
    for (const std::size_t threads : {1, 2, 5}) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        EXPECT_TRUE(same(mended(mesh).mesh, once));
    }
}

TEST(Repair, BadInputIsRefused) {
    EXPECT_THROW(repair(mesh_of({{0, 0, 0}}, {{0, 1, 2}})), InvalidInput);
    RepairOptions options;
    options.max_hole_edges = 2;
    EXPECT_THROW(repair(cube(), options), InvalidInput);
    EXPECT_THROW(repair(cube(), {}, Progress([](double) { return false; })), Cancelled);
}

TEST(Untangle, ASpikeThroughTheOtherSideIsDrawnBack) {
    if (!have_self_intersections()) GTEST_SKIP() << "built without CGAL";
    TriMesh mesh = icosphere(3, 1);
    mesh.points[0] *= -1.3f;
    mesh.points[50] *= -1.2f;
    const RepairResult r = mended(mesh, true, true);
    EXPECT_GT(r.report.intersecting_faces_before.value(), 0u);
    EXPECT_EQ(r.report.intersecting_faces_after, 0u);
    EXPECT_TRUE(self_intersections(r.mesh).empty());
    EXPECT_TRUE(good(r.mesh));
    EXPECT_GT(r.report.moved_vertices, 1u);
    std::size_t moved = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) moved += mesh.points[v] != r.mesh.points[v];
    EXPECT_EQ(moved, r.report.moved_vertices);
    EXPECT_LT(moved, mesh.points.size() / 10);
    EXPECT_EQ(measure_mesh(r.mesh).components, 1u);
}

TEST(Untangle, ATubeThatCutsItselfIsFilledAnewThere) {
    if (!have_self_intersections()) GTEST_SKIP() << "built without CGAL";
    const TriMesh mesh = flat_eight(0.1, 40, 10);
    const RepairResult r = mended(mesh, true, true);
    EXPECT_GT(r.report.refilled_faces, 0u);
    EXPECT_LT(*r.report.intersecting_faces_after, *r.report.intersecting_faces_before / 2);
    EXPECT_TRUE(good(r.mesh));
    EXPECT_EQ(measure_mesh(r.mesh).components, 1u);
}

TEST(Untangle, CrossingSpheresAreReportedNotMended) {
    if (!have_self_intersections()) GTEST_SKIP() << "built without CGAL";
    const TriMesh mesh =
        joined(icosphere(2, 1), moved(icosphere(2, 1), Mat3d::Identity(), Vec3d(1, 0.01, 0.02)));
    const RepairResult r = mended(mesh, true, true);
    EXPECT_TRUE(same(r.mesh, mesh));
    EXPECT_GT(r.report.intersecting_faces_before.value(), 0u);
    EXPECT_EQ(r.report.intersecting_faces_after, r.report.intersecting_faces_before);
}

TEST(Untangle, SheetsThatTouchAreDrawnApart) {
    if (!have_self_intersections()) GTEST_SKIP() << "built without CGAL";
    for (const TriMesh& mesh : {two_cubes_sharing_an_edge(), two_cubes_sharing_a_vertex()}) {
        const RepairResult r = mended(mesh, true, true);
        EXPECT_GT(r.report.intersecting_faces_before.value(), 0u);
        EXPECT_EQ(r.report.intersecting_faces_after, 0u);
        EXPECT_EQ(measure_mesh(r.mesh).components, 2u);
        EXPECT_NEAR(volume(r.mesh), 2, 0.2);
    }
}

TEST(Untangle, AGoodMeshComesBackAsItIs) {
    if (!have_self_intersections()) GTEST_SKIP() << "built without CGAL";
    for (const TriMesh& mesh : {TriMesh(), cube(), icosphere(2, 2), torus_mesh(3, 1, 24, 12)}) {
        const RepairResult r = mended(mesh, true, true);
        EXPECT_TRUE(same(r.mesh, mesh));
        EXPECT_EQ(r.report.intersecting_faces_before, 0u);
        EXPECT_EQ(r.report.intersecting_faces_after, 0u);
    }
}

TEST(Untangle, NobodyLooksWhereNotAsked) {
    RepairOptions options;
    options.self_intersections = false;
    EXPECT_FALSE(repair(cube(), options).report.intersecting_faces_before);
}

TEST(FillHoles, TheLidOfATubeIsFlat) {
    // Beyond 128 edges ears are cut first; a flat lid has the area of its polygon either way.
    for (const int around : {3, 12, 128, 400}) {
        TriMesh mesh = open_cylinder_mesh(1, 2, 4, around);
        const double wall = measure_mesh(mesh).area_A2;
        const FilledHoles counts = fill_holes(mesh, 1000);
        EXPECT_EQ(counts.filled, 2u);
        EXPECT_EQ(counts.faces, 2u * std::size_t(around - 2));
        EXPECT_TRUE(good(mesh));
        EXPECT_NEAR(measure_mesh(mesh).area_A2 - wall, around * std::sin(2 * M_PI / around), 1e-4);
        EXPECT_GT(volume(mesh), 0);
    }
}

TEST(FillHoles, AWavyRimOfAThousandEdges) {
    // Three neighbours on a crest lie in the wall: an ear there would fold back onto it.
    TriMesh mesh = ring_mesh(5, 1000, false, [](int r, int c) {
        const double u = 2 * M_PI * c / 1000, far = 1 + 0.3 * std::sin(9 * u);
        return Vec3d(far * std::cos(u), far * std::sin(u), 0.5 * r + 0.4 * std::sin(5 * u));
    });
    EXPECT_EQ(fill_holes(mesh, 1000).filled, 2u);
    EXPECT_TRUE(good(mesh));
    EXPECT_NEAR(volume(mesh), 2 * M_PI * (1 + 0.045), 1);
}

TEST(FillHoles, ChordsThatTheMeshHasElsewhereAreNotUsed) {
    // An octahedron without two neighbouring faces: the hole's one chord that is left free is the diagonal
    // across.
    const TriMesh whole = icosphere(0, 1);
    for (std::size_t f = 0; f < whole.triangles.size(); ++f)
        for (std::size_t g = f + 1; g < whole.triangles.size(); ++g) {
            TriMesh mesh = without(whole, {f, g});
            if (!measure_mesh(mesh).manifold) continue;
            fill_holes(mesh, 10);
            EXPECT_TRUE(good(mesh));
        }
}

TEST(FillHoles, ALoopWhoseChordsAreAllEdgesGetsAMiddle) {
    // The torus of seven vertices, each joined to each, without the faces at vertex 0.
    TriMesh mesh;
    for (int i = 0; i < 7; ++i)
        mesh.points.emplace_back(float(std::cos(2.5 * i)), float(std::sin(2.5 * i)), float(i * i % 5));
    for (VertexId i = 0; i < 7; ++i) {
        const Triangle a = {i, (i + 1) % 7, (i + 3) % 7}, b = {i, (i + 3) % 7, (i + 2) % 7};
        for (const Triangle& t : {a, b})
            if (std::count(t.begin(), t.end(), 0u) == 0) mesh.triangles.push_back(t);
    }
    mesh.vertex_properties.push_back({"v", 1, {99, 1, 2, 3, 4, 5, 6}});
    const FilledHoles counts = fill_holes(mesh, 10);
    check(mesh, "filled");
    EXPECT_EQ(counts.vertices, 1u);
    EXPECT_EQ(counts.faces, 6u);
    EXPECT_EQ(mesh.vertex_properties[0].values.back(), 3.5f);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.genus, 1);
}
