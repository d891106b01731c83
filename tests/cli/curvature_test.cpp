// vdbgeo curvature: its methods, tables, samples and refusals.
#include <cmath>
#include <sstream>

#include "converters/mesh_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/meshes.h"

using namespace vdbgeo::test;
using vdbgeo::TriMesh;

namespace {

class Curvature : public Cli {
 protected:
    /// A sphere of radius 14 Å in a map of its own, and its surface.
    void SetUp() override {
        map_ = phantom("sphere.mrc", 40, {"--radius", "14"});
        mesh_ = at("sphere.ply");
        good({"surface", map_, mesh_, "--iso", "0", "--quiet"});
    }
    TriMesh written(const std::string& name) const { return vdbgeo::read_mesh(at(name)); }

    std::string map_, mesh_;
};

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
}

}  // namespace

TEST_F(Curvature, OfASphereIsOneOverItsRadius) {
    const Json adaptive = json({"curvature", mesh_, at("a.ply")});
    EXPECT_EQ(adaptive["method"], "adaptive");
    EXPECT_GT(adaptive["radius_A"].get<double>(), 0);
    const Json field = json({"curvature", mesh_, at("f.ply"), "--map", map_});
    EXPECT_EQ(field["method"], "field");
    EXPECT_GT(field["scale_voxels"].get<double>(), 0);
    for (const Json& j : {adaptive, field}) {
        EXPECT_EQ(j["undefined"], 0);
        EXPECT_EQ(j["border_vertices"], 0);
        for (const char* key : {"H_per_A", "k1_per_A", "k2_per_A", "curvedness_per_A"})
            EXPECT_NEAR(j[key]["median"].get<double>(), 1.0 / 14, 0.005 / 14) << key;
        EXPECT_NEAR(j["K_per_A2"]["median"].get<double>(), 1.0 / 196, 0.01 / 196);
        EXPECT_NEAR(j["shape_index"]["mean"].get<double>(), -1, 0.03);
        EXPECT_NEAR(j["area_by_type_A2"]["peak"].get<double>(), j["area_A2"].get<double>(),
                    1e-9 * j["area_A2"].get<double>());
        EXPECT_NEAR(j["integral_H2"].get<double>(), 4 * M_PI, 0.01 * 4 * M_PI);
    }
}

TEST_F(Curvature, EveryMethodWritesItsProperties) {
    const std::vector<Words> methods{{"adaptive"},
                                     {"jets", "--degree", "3", "--rings", "4"},
                                     {"jets", "--radius", "4"},
                                     {"tensor", "--radius", "4"},
                                     {"tensor", "--neighbourhood", "geodesic"},
                                     {"tensor", "--neighbourhood", "ring"},
                                     {"voting", "--radius", "5"},
                                     {"discrete", "--area", "voronoi"},
                                     {"field", "--map", map_, "--scale", "1.5"}};
    for (const Words& method : methods) {
        Words words{"curvature", mesh_, at("out.ply"), "--method"};
        words.insert(words.end(), method.begin(), method.end());
        const Json j = json(words);
        EXPECT_EQ(j["method"], method[0]);
        const TriMesh mesh = written("out.ply");
        for (const char* name :
             {"K", "H", "k1", "k2", "shape_index", "curvedness", "type", "curvature_flags"})
            EXPECT_TRUE(mesh.find_vertex_property(name)) << method[0] << " " << name;
        EXPECT_EQ(mesh.find_vertex_property("direction1") != nullptr, method[0] != "discrete");
        // The mean over the area; one ring on slivers is only right on average.
        EXPECT_NEAR(j["H_per_A"]["mean"].get<double>(), 1.0 / 14, 0.1 / 14) << method[0];
    }
    const Json discrete = json({"curvature", mesh_, at("out.ply"), "--method", "discrete"});
    EXPECT_NEAR(discrete["integral_K"].get<double>(), 4 * M_PI, 1e-9);
}

TEST_F(Curvature, TablesHaveOneLineAVertex) {
    json({"curvature", mesh_, at("out.ply"), "--table", at("out.csv"), "--sample", "density=" + map_,
          "--histogram", at("out.png")});
    const TriMesh mesh = written("out.ply");
    const auto lines = lines_of(bytes("out.csv"));
    ASSERT_EQ(lines.size(), mesh.points.size() + 1);
    EXPECT_EQ(lines[0].rfind("vertex,x_A,y_A,z_A,area_A2,K_per_A2,H_per_A,k1_per_A,k2_per_A,", 0), 0u);
    EXPECT_NE(lines[0].find(",density"), std::string::npos);
    const auto fields = std::count(lines[0].begin(), lines[0].end(), ',');
    for (const std::string& line : lines) EXPECT_EQ(std::count(line.begin(), line.end(), ','), fields);
    const vdbgeo::MeshProperty* density = mesh.find_vertex_property("density");
    ASSERT_TRUE(density);
    for (const float v : density->values) EXPECT_NEAR(v, 0, 0.05);  // on the surface of isovalue 0
    EXPECT_EQ(bytes("out.png").substr(1, 3), "PNG");
}

TEST_F(Curvature, SamplesOffTheSurface) {
    // The phantom is a distance field, positive inside.
    const Json in =
        json({"curvature", mesh_, at("out.ply"), "--sample", "d=" + map_, "--sample-offset", "-2"});
    EXPECT_NEAR(in["sampled"]["d"]["mean"].get<double>(), 2, 0.1);
    const Json out =
        json({"curvature", mesh_, at("out.ply"), "--sample", "d=" + map_, "--sample-offset", "2"});
    EXPECT_NEAR(out["sampled"]["d"]["mean"].get<double>(), -2, 0.1);
}

TEST_F(Curvature, RefusesWhatMakesNoSense) {
    const auto fails = [&](Words words, int code, const std::string& subject, const std::string& text = "") {
        words.insert(words.begin(), {"curvature", mesh_, at("bad.ply"), "--quiet"});
        expect_error(vdbgeo(words), code, subject, text);
        EXPECT_FALSE(listing().count("bad.ply"));
    };
    fails({"--degree", "3"}, 2, "--degree", "jets");
    fails({"--method", "jets", "--degree", "7"}, 2, "");
    fails({"--method", "jets", "--scale", "2"}, 2, "--scale", "field");
    fails({"--method", "field"}, 2, "--method field", "--map");
    fails({"--radius", "-1"}, 2, "");
    fails({"--sample", "density"}, 2, "--sample density", "NAME=MAP");
    fails({"--sample", "a b=" + map_}, 2, "--sample a b=", "letters");
    fails({"--sample", "k1=" + map_}, 2, "--sample k1=", "own");
    fails({"--sample", "x=" + map_}, 2, "--sample x=", "own");
    fails({"--sample", "a=" + map_, "--sample", "a=" + map_}, 2, "--sample a=", "twice");
    fails({"--voxel-size", "3"}, 2, "--voxel-size", "--map");
    fails({"--method", "jets", "--rings", "3", "--radius", "5"}, 2, "--rings", "--radius");
    fails({"--method", "tensor", "--neighbourhood", "ring", "--radius", "5"}, 2, "--radius", "ring");
    fails({"--table", at("no/t.csv")}, 4, at("no/t.csv"), "no folder");
    fails({"--sample-offset", "1"}, 2, "--sample-offset", "--sample");
    fails({"--map", at("none.mrc")}, 4, at("none.mrc"));
    fails({"--table", at("t.txt")}, 2, at("t.txt"), ".csv");
    expect_error(vdbgeo({"curvature", at("none.ply"), at("bad.ply"), "--quiet"}), 4, at("none.ply"));

    // A sheet of two faces that are turned against each other has no outside.
    TriMesh turned = icosphere(2, 5);
    std::swap(turned.triangles[0][0], turned.triangles[0][1]);
    vdbgeo::write_mesh(turned, at("turned.ply"));
    expect_error(vdbgeo({"curvature", at("turned.ply"), at("bad.ply"), "--quiet"}), 3, at("turned.ply"),
                 "repair");
    vdbgeo::write_mesh(moved(icosphere(3, 1), vdbgeo::Mat3d::Identity(), {1e6, 0, 0}), at("far.ply"));
    expect_error(vdbgeo({"curvature", at("far.ply"), at("bad.ply"), "--quiet"}), 3, at("far.ply"), "origin");
    EXPECT_FALSE(listing().count("bad.ply"));
}

TEST_F(Curvature, SameBytesForAnyThreads) {
    for (const Words& method : {Words{}, Words{"--map", map_}, Words{"--method", "voting"}}) {
        std::set<std::string> outputs;
        for (const char* threads : {"1", "2", "3"}) {
            Words words{"curvature", mesh_, at("t.ply"), "--threads", threads, "--quiet"};
            words.insert(words.end(), method.begin(), method.end());
            good(words);
            outputs.insert(bytes("t.ply"));
        }
        EXPECT_EQ(outputs.size(), 1u);
    }
}

TEST_F(Curvature, SaysWhereFacesAreTurnedInward) {
    vdbgeo::write_mesh(flipped(icosphere(3, 5)), at("inward.ply"));
    const Ended r = good({"curvature", at("inward.ply"), at("i.ply"), "--quiet"});
    EXPECT_NE(r.err.find("turned inward"), std::string::npos) << r.err;
    EXPECT_EQ(good({"curvature", mesh_, at("o.ply"), "--quiet"}).err, "");
}

TEST_F(Curvature, LeavesNoDirectionsOfAnotherMethod) {
    good({"curvature", mesh_, at("one.ply"), "--quiet"});
    EXPECT_TRUE(written("one.ply").find_vertex_property("direction1"));
    good({"curvature", at("one.ply"), at("two.ply"), "--method", "discrete", "--quiet"});
    EXPECT_FALSE(written("two.ply").find_vertex_property("direction1"));
    EXPECT_FALSE(written("two.ply").find_vertex_property("direction2"));
}

TEST_F(Curvature, OfAMeshThatTheMapDoesNotReachIsNone) {
    const Json j = json({"curvature", mesh_, at("far.ply"), "--map", map_, "--origin", "5000,0,0"});
    EXPECT_EQ(j["undefined"], j["vertices"]);
    EXPECT_TRUE(j["H_per_A"]["mean"].is_null()) << j.dump();
}
