// vdbgeo cutaway: meshes and pictures of what is inside, and refusals.
#include <cmath>

#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/tet_meshes.h"

using namespace vdbgeo::test;
using vdbgeo::TriMesh;

namespace {

class Cutaway : public Cli {
 protected:
    void SetUp() override {
        mesh_ = at("ball.vtu");
        vdbgeo::write_tets(ball_tets(10, 2.5), mesh_);
    }
    TriMesh written(const std::string& name) const { return vdbgeo::read_mesh(at(name)); }

    std::string mesh_;
};

/// How far the faces that were cut open reach.
std::pair<vdbgeo::Vec3f, vdbgeo::Vec3f> box_of_opened(const TriMesh& mesh) {
    vdbgeo::Vec3f low = vdbgeo::Vec3f::Constant(1e9f), high = -low;
    const auto& interior = mesh.find_face_property("interior")->values;
    for (std::size_t f = 0; f < interior.size(); ++f)
        if (interior[f] > 0)
            for (const auto v : mesh.triangles[f]) {
                low = low.cwiseMin(mesh.points[v]);
                high = high.cwiseMax(mesh.points[v]);
            }
    return {low, high};
}

}  // namespace

TEST_F(Cutaway, ByPlanes) {
    const Json whole = json({"cutaway", mesh_, at("whole.ply")});
    EXPECT_EQ(whole["mode"], "whole");
    for (const char* key : {"vertices", "tets", "volume_A3", "min_dihedral_deg", "max_dihedral_deg",
                            "radius_edge_max", "radius_edge_mean", "slivers", "inverted", "boundary_faces",
                            "min_dihedral_p01_deg", "mean_edge_A", "regions", "faces", "interior_faces"})
        EXPECT_TRUE(whole.contains(key)) << key;
    const TriMesh mesh = written("whole.ply");
    EXPECT_EQ(whole["faces"], mesh.triangles.size());
    for (const char* name : {"interior", "region", "min_dihedral_deg", "radius_edge", "volume_A3"}) {
        EXPECT_TRUE(mesh.find_face_property(name)) << name;
        EXPECT_TRUE(mesh.find_vertex_property(name)) << name;
    }
    // What is before the front view goes: y from below 0 on.
    const auto [low, high] = box_of_opened(mesh);
    EXPECT_LT(std::abs(low.y()), 2.5f);
    EXPECT_LT(std::abs(high.y()), 2.5f);

    json({"cutaway", mesh_, at("clip.vtp"), "--plane", "0,0,2,6", "--clip"});
    const auto [first, last] = box_of_opened(written("clip.vtp"));
    EXPECT_NEAR(first.z(), 3, 1e-5);
    EXPECT_NEAR(last.z(), 3, 1e-5);
    json({"cutaway", mesh_, at("part.ply"), "--plane", "x", "--clip", "--at", "0.75"});
    EXPECT_NEAR(box_of_opened(written("part.ply")).first.x(), 5, 0.5);
}

TEST_F(Cutaway, ByPeeling) {
    const Json j = json({"cutaway", mesh_, at("peel.ply"), "--peel", "40", "--from", "0,0,20"});
    EXPECT_EQ(j["mode"], "peel");
    EXPECT_GT(j["interior_faces"], 0);
    const auto [low, high] = box_of_opened(written("peel.ply"));
    EXPECT_GT(high.z(), 7);
    EXPECT_GT(low.z(), -5);
    json({"cutaway", mesh_, at("seed.ply"), "--peel", "1", "--seed-face", "0"});
    expect_error(vdbgeo({"cutaway", mesh_, at("bad.ply"), "--quiet", "--peel", "100000000"}), 5, mesh_,
                 "left");
    expect_error(
        vdbgeo({"cutaway", mesh_, at("bad.ply"), "--quiet", "--peel", "1", "--seed-face", "99999999"}), 3,
        mesh_, "seed face 99999999");
    EXPECT_FALSE(listing().count("bad.ply"));
}

TEST_F(Cutaway, Pictures) {
    const Words quick{"--width", "160", "--occlusion", "0", "--samples", "1"};
    std::set<std::string> pictures;
    for (const Words& words :
         {Words{}, Words{"--no-edges"}, Words{"--property", "radius_edge"},
          Words{"--property", "volume_A3", "--min", "0", "--max", "9"}, Words{"--property", "region"},
          Words{"--view", "iso"}, Words{"--peel", "60"}, Words{"--clip", "--plane", "1,1,1"}}) {
        Words all{"cutaway", mesh_, at("out.png"), "--quiet"};
        all.insert(all.end(), words.begin(), words.end());
        all.insert(all.end(), quick.begin(), quick.end());
        good(all);
        EXPECT_EQ(bytes("out.png").substr(1, 3), "PNG");
        pictures.insert(bytes("out.png"));
    }
    EXPECT_EQ(pictures.size(), 8u);  // no two are the same
    good({"cutaway", mesh_, at("out.ply"), "--histogram", at("angles.png"), "--quiet"});
    EXPECT_EQ(bytes("angles.png").substr(1, 3), "PNG");
}

TEST_F(Cutaway, RenderDrawsTheBoundary) {
    good({"render", mesh_, at("plain.png"), "--width", "160", "--quiet", "--occlusion", "0"});
    good({"render", mesh_, at("edges.png"), "--width", "160", "--quiet", "--occlusion", "0", "--edges",
          "--color-by", "region", "--view", "1,-2,1"});
    EXPECT_NE(bytes("plain.png"), bytes("edges.png"));
}

TEST_F(Cutaway, RefusesWhatMakesNoSense) {
    const auto fails = [&](Words words, const std::string& subject, const std::string& text = "") {
        words.insert(words.begin(), {"cutaway", mesh_, at("bad.ply"), "--quiet"});
        expect_error(vdbgeo(words), 2, subject, text);
        EXPECT_FALSE(listing().count("bad.ply"));
    };
    fails({"--peel", "5", "--plane", "x"}, "--plane", "--peel");
    fails({"--peel", "5", "--clip"}, "--clip", "--peel");
    fails({"--peel", "5", "--at", "0.5"}, "--at", "--peel");
    fails({"--seed-face", "5"}, "--seed-face", "--peel");
    fails({"--from", "0,0,0"}, "--from", "--peel");
    fails({"--peel", "5", "--seed-face", "1", "--from", "0,0,0"}, "--from", "--seed-face");
    fails({"--peel", "-5"}, "--peel");
    fails({"--peel", "1", "--seed-face", "-1"}, "--seed-face");
    fails({"--peel", "5", "--from", "0,0"}, "--from", "x,y,z");
    fails({"--plane", "w"}, "--plane", "'w'");
    fails({"--plane", "1,2"}, "--plane", "'1,2'");
    fails({"--plane", "0,0,0"}, "--plane", "no direction");
    fails({"--plane", "0,0,nan"}, "--plane", "nan");
    fails({"--plane", "0,0,1,"}, "--plane");
    fails({"--plane", "0,0,1,5", "--at", "0.3"}, "--at", "NX,NY,NZ,D");
    fails({"--at", "1.5"}, "--at", "0 to 1");
    fails({"--width", "300"}, "--width", ".png");
    fails({"--view", "iso"}, "--view", ".png");
    fails({"--property", "region"}, "--property", ".png");
    fails({"--histogram", at("h.txt")}, at("h.txt"), ".png");
    expect_error(vdbgeo({"cutaway", mesh_, at("bad.txt"), "--quiet"}), 2, at("bad.txt"), ".png");
    expect_error(vdbgeo({"cutaway", mesh_, at("bad.png"), "--quiet", "--property", "K"}), 2, "");
    expect_error(vdbgeo({"cutaway", mesh_, at("bad.png"), "--quiet", "--view", "back"}), 2, "", "back");
    expect_error(vdbgeo({"cutaway", at("none.vtu"), at("bad.ply"), "--quiet"}), 4, at("none.vtu"));
    expect_error(vdbgeo({"cutaway", mesh_, at("no/bad.ply"), "--quiet"}), 4, at("no/bad.ply"), "no folder");
    expect_error(vdbgeo({"cutaway", make("bad.vtu", "<VTKFile"), at("bad.ply"), "--quiet"}), 3,
                 at("bad.vtu"));
    expect_error(vdbgeo({"cutaway", mesh_, at("bad.ply"), "--quiet", "--plane", "0,0,1,-50"}), 5, mesh_,
                 "left");
    good({"cutaway", mesh_, at("all.ply"), "--quiet", "--plane", "0,0,-1,50"});
    EXPECT_FALSE(listing().count("bad.ply"));
}

TEST_F(Cutaway, SameBytesForAnyThreads) {
    for (const Words& way : {Words{}, Words{"--clip"}, Words{"--peel", "50"}}) {
        std::set<std::string> outputs;
        for (const char* threads : {"1", "2", "3"}) {
            Words words{"cutaway", mesh_, at("t.ply"), "--threads", threads, "--quiet"};
            words.insert(words.end(), way.begin(), way.end());
            good(words);
            outputs.insert(bytes("t.ply"));
        }
        EXPECT_EQ(outputs.size(), 1u);
    }
}
