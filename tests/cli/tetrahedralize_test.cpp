#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "converters/map_file.h"
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "converters/vdb_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/meshes.h"
#include "tests/support/small_meshes.h"

namespace vdbgeo {
namespace {

using test::expect_error;
using test::Json;
using test::Words;

class Tetrahedralize : public test::Cli {
 protected:
    std::string mesh_file(const std::string& name, const TriMesh& mesh) const {
        write_mesh(mesh, at(name));
        return at(name);
    }
};

/// The stable keys, and a mesh without faults whose volume is the surface's.
void expect_sound(const Json& j, double volume_error) {
    for (const char* key : {"vertices", "tets", "volume_A3", "min_dihedral_deg", "max_dihedral_deg",
                            "radius_edge_max", "radius_edge_mean", "slivers", "inverted", "method"})
        EXPECT_TRUE(j.contains(key)) << key;
    EXPECT_EQ(j["inverted"], 0);
    EXPECT_GT(j["tets"].get<int>(), 100);
    EXPECT_LT(std::abs(j["volume_error"].get<double>()), volume_error);
}

TEST_F(Tetrahedralize, AMapByEachMethod) {
    const std::string map = phantom("ball.mrc", 28);
    for (const std::string method : {"stuffing", "cgal", "tetgen", "netgen"}) {
        const std::string out = at(method + ".vtu");
        const Json j = json({"tetrahedralize", map, out, "--iso", "0", "--method", method, "--quiet"});
        expect_sound(j, 0.02);
        EXPECT_EQ(j["method"], method);
        const TetMesh mesh = read_tets(out);
        EXPECT_EQ(mesh.tets.size(), j["tets"].get<std::size_t>());
        EXPECT_EQ(mesh.faces.size(), j["boundary_faces"].get<std::size_t>());
    }
    const Json j = json({"tetrahedralize", map, at("default.msh"), "--iso", "0", "--quiet"});
    EXPECT_EQ(j["method"], "stuffing");
    EXPECT_GT(j["min_dihedral_deg"].get<double>(), 10.7);
    EXPECT_LT(j["max_dihedral_deg"].get<double>(), 164.8);
}

TEST_F(Tetrahedralize, OptimizingRaisesTheAngles) {
    const std::string map = phantom("ball.mrc", 28);
    const Words words{"tetrahedralize", map, at("a.vtu"), "--iso", "0", "--quiet"};
    Words better = words;
    better.insert(better.end(), {"--optimize", "--optimize-bounds", "28:125"});
    const Json before = json(words), after = json(better);
    EXPECT_GT(after["min_dihedral_deg"].get<double>(), before["min_dihedral_deg"].get<double>() + 3);
    EXPECT_LT(after["max_dihedral_deg"].get<double>(), before["max_dihedral_deg"].get<double>() - 3);
    EXPECT_GT(after["optimize"]["moves"].get<int>() + after["optimize"]["flips"].get<int>(), 0);
    expect_sound(after, 0.02);
}

TEST_F(Tetrahedralize, AMeshKeepsItsTrianglesInTetgen) {
    const TriMesh ball = test::icosphere(3, 10);
    const std::string in = mesh_file("ball.ply", ball);
    const Json j = json({"tetrahedralize", in, at("ball.mesh"), "--quiet"});
    EXPECT_EQ(j["method"], "tetgen");
    expect_sound(j, 1e-6);
    EXPECT_LT(j["hausdorff_A"].get<double>(), 1e-5);
    const TetMesh mesh = read_tets(at("ball.mesh"));
    ASSERT_GE(mesh.points.size(), ball.points.size());
    for (std::size_t v = 0; v < ball.points.size(); ++v)
        EXPECT_EQ(mesh.points[v], ball.points[v].cast<double>()) << v;
    EXPECT_EQ(mesh.faces.size(), ball.triangles.size());
    for (const std::string method : {"stuffing", "cgal", "netgen"})
        expect_sound(json({"tetrahedralize", in, at(method + ".vtu"), "--method", method, "--quiet"}), 0.05);
}

TEST_F(Tetrahedralize, SameBytesForAnyThreads) {
    const std::string map = phantom("torus.mrc", 32, {}, "torus");
    for (const std::string method : {"stuffing", "cgal", "tetgen", "netgen"}) {
        for (const char* threads : {"1", "2"})
            good({"tetrahedralize", map, at(method + threads + ".vtu"), "--iso", "0", "--method", method,
                  "--optimize", "--threads", threads, "--quiet", "--no-distance"});
        EXPECT_EQ(bytes(method + "1.vtu"), bytes(method + "2.vtu")) << method;
    }
}

TEST_F(Tetrahedralize, CompareWritesATableAPictureAndTheMeshes) {
    const std::string map = phantom("ball.mrc", 24);
    const Json j = json({"tetrahedralize", map, at("all"), "--compare", "--iso", "0", "--quiet"});
    ASSERT_EQ(j["methods"].size(), 4u);
    for (const Json& row : j["methods"]) {
        EXPECT_FALSE(row.contains("error")) << row;
        EXPECT_GT(row["peak_bytes"].get<double>(), 1e6);
        EXPECT_EQ(row["inverted"], 0);
    }
    EXPECT_EQ(listing(), (std::set<std::string>{"ball.mrc", "all", "all/comparison.csv", "all/comparison.png",
                                                "all/stuffing.vtu", "all/cgal.vtu", "all/tetgen.vtu",
                                                "all/netgen.vtu"}));
    std::istringstream csv(bytes("all/comparison.csv"));
    std::string head, line;
    std::getline(csv, head);
    EXPECT_EQ(head.rfind("method,seconds,", 0), 0u) << head;
    int lines = 0;
    while (std::getline(csv, line)) {
        ++lines;
        EXPECT_EQ(std::count(line.begin(), line.end(), ','), std::count(head.begin(), head.end(), ','))
            << line;
    }
    EXPECT_EQ(lines, 4);
}

TEST_F(Tetrahedralize, LabelsBecomeRegions) {
    const std::string map = at("labels.mrc");
    good({"phantom", "sphere", at("ball.mrc"), "--size", "32", "--quiet"});
    // Two halves of a ball, as a segmentation.
    {
        MapFile in = read_map(at("ball.mrc"));
        for (auto it = in.map.grid->beginValueAll(); it; ++it) it.setValue(0);
        auto write = in.map.grid->getAccessor();
        for (int x = 4; x < 28; ++x)
            for (int y = 4; y < 28; ++y)
                for (int z = 4; z < 28; ++z)
                    if (Vec3d(x - 15.5, y - 15.5, z - 15.5).norm() < 11)
                        write.setValueOn(openvdb::Coord(x, y, z), x < 16 ? 1.0f : 2.0f);
        write_vdb({in.map.grid}, at("labels.vdb"));
        good({"convert", at("labels.vdb"), map, "--quiet"});
    }
    const Json j = json({"tetrahedralize", map, at("l.msh"), "--labels", "all", "--quiet"});
    EXPECT_EQ(j["method"], "cgal");
    ASSERT_EQ(j["regions"].size(), 2u);
    EXPECT_NEAR(j["regions"][0]["volume_A3"].get<double>() / j["regions"][1]["volume_A3"].get<double>(), 1,
                0.05);
    const TetMesh mesh = read_tets(at("l.msh"));
    bool between = false;
    for (const auto& pair : mesh.face_regions) between = between || (pair[0] == 1 && pair[1] == 2);
    EXPECT_TRUE(between);
    expect_error(vdbgeo({"tetrahedralize", map, at("x.msh"), "--labels", "7", "--quiet"}), 3, map, "7");
    expect_error(
        vdbgeo({"tetrahedralize", map, at("x.msh"), "--labels", "all", "--method", "stuffing", "--quiet"}), 2,
        "--method stuffing");
}

TEST_F(Tetrahedralize, BadSurfacesAreRefusedByName) {
    TriMesh open = test::icosphere(2, 10);
    open.triangles.pop_back();
    const TriMesh cut = test::joined(test::icosphere(2, 10),
                                     test::moved(test::icosphere(2, 10), Mat3d::Identity(), Vec3d(5, 0, 0)));
    const struct {
        const char* name;
        TriMesh mesh;
        const char* reason;
    } cases[] = {{"open.ply", open, "open"},
                 {"inside-out.ply", test::flipped(test::icosphere(2, 10)), "inside out"},
                 {"cut.ply", cut, "cut"},
                 {"empty.ply", {}, "face"},
                 {"moebius.ply", test::moebius(20), "open"}};
    for (const auto& c : cases) {
        const std::string in = mesh_file(c.name, c.mesh);
        for (const std::string method : {"tetgen", "netgen"})
            expect_error(vdbgeo({"tetrahedralize", in, at("x.vtu"), "--method", method, "--quiet"}), 3, in,
                         c.reason);
        EXPECT_FALSE(std::filesystem::exists(at("x.vtu")));
    }
    const std::string claims = make("claims.ply",
                                    "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\n"
                                    "property float x\nproperty float y\nproperty float z\n"
                                    "element face 0\nproperty list uchar int vertex_indices\nend_header\n");
    expect_error(vdbgeo({"tetrahedralize", claims, at("x.vtu"), "--quiet"}), 3, claims);
}

TEST_F(Tetrahedralize, WhatCannotBeDoneEndsWithAReason) {
    const std::string map = phantom("ball.mrc", 24);
    expect_error(vdbgeo({"tetrahedralize", map, at("x.vtu"), "--iso", "1e6", "--quiet"}), 5, map, "1e+06");
    expect_error(vdbgeo({"tetrahedralize", map, at("x.vtu"), "--iso", "0", "--max-tets", "10", "--quiet"}), 5,
                 map, "10");
    expect_error(vdbgeo({"tetrahedralize", map, at("x.vtu"), "--iso", "0", "--cell", "500", "--quiet"}), 5,
                 map);
    expect_error(vdbgeo({"tetrahedralize", at("none.mrc"), at("x.vtu"), "--quiet"}), 4, at("none.mrc"));
    expect_error(vdbgeo({"tetrahedralize", map, at("nowhere/x.vtu"), "--iso", "0", "--quiet"}), 4,
                 at("nowhere/x.vtu"));
    EXPECT_FALSE(std::filesystem::exists(at("x.vtu")));
}

TEST_F(Tetrahedralize, FlagsOfAnotherMethodAreRefused) {
    const std::string map = phantom("ball.mrc", 24);
    const auto refused = [&](const Words& more, const std::string& subject) {
        Words words{"tetrahedralize", map, at("x.vtu")};
        words.insert(words.end(), more.begin(), more.end());
        expect_error(vdbgeo(words), 2, subject);
    };
    refused({"--method", "stuffing", "--exude"}, "--exude");
    refused({"--exude"}, "--exude");
    refused({"--method", "tetgen", "--cell", "2"}, "--cell");
    refused({"--method", "cgal", "--grading", "0.5"}, "--grading");
    refused({"--cell", "-1"}, "--cell");
    refused({"--optimize-bounds", "20:130"}, "--optimize-bounds");
    refused({"--optimize", "--optimize-bounds", "20"}, "--optimize-bounds");
    refused({"--method", "cgal", "--size-by", "curvature"}, "--size-by");
    refused({"--compare", "--method", "cgal"}, "--method");
    refused({"--keep-largest", "0"}, "keep the largest 0");
    expect_error(vdbgeo({"tetrahedralize", map, at("x.ply"), "--quiet"}), 2, at("x.ply"), ".vtu");
}

}  // namespace
}  // namespace vdbgeo
