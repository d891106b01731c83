// The commands that make and mend surfaces: surface by each method, remesh, simplify, smooth, repair,
// components.
#include "converters/mesh_file.h"
#include "converters/mrc.h"
#include "tests/cli/cli_test.h"
#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/surface/delaunay_surface.h"

using namespace vdbgeo::test;
using vdbgeo::TriMesh;

namespace {

class Surfaces : public Cli {
 protected:
    std::string mesh(const std::string& name, const TriMesh& m) const {
        vdbgeo::write_mesh(m, folder_ / name);
        return at(name);
    }

    void expect_sound(const Json& j) const {
        EXPECT_EQ(j["closed"], true) << j.dump();
        EXPECT_EQ(j["manifold"], true) << j.dump();
        EXPECT_EQ(j["oriented"], true) << j.dump();
    }
};

}  // namespace

TEST_F(Surfaces, ThreeMethodsGiveTheSameSphere) {
    const std::string map = phantom("a.mrc", 48);
    const Json mc = json({"surface", map, at("mc.ply"), "--iso", "0"});
    expect_sound(mc);
    EXPECT_EQ(mc["method"], "marching-cubes");
    std::vector<std::string> methods{"dual"};
    if (vdbgeo::have_delaunay()) methods.push_back("delaunay");
    for (const std::string& method : methods) {
        const Json j = json({"surface", map, at(method + ".ply"), "--iso", "0", "--method", method});
        expect_sound(j);
        EXPECT_EQ(j["method"], method);
        EXPECT_EQ(j["components"], mc["components"]);
        EXPECT_EQ(j["genus"], 0);
        EXPECT_NEAR(j["volume_A3"].get<double>(), mc["volume_A3"].get<double>(),
                    0.02 * mc["volume_A3"].get<double>())
            << method;
        if (method == "delaunay") {
            EXPECT_GE(j["min_angle_deg"].get<double>(), 30 - 1e-3);
        }
    }
}

TEST_F(Surfaces, BoundsAreInVoxelsOrAngstroms) {
    if (!vdbgeo::have_delaunay()) GTEST_SKIP() << "this build has no CGAL";
    const std::string map = phantom("a.mrc", 32, {"--voxel-size", "2"});
    const auto surface = [&](const Words& bounds) {
        Words words{"surface", map, at("d.ply"), "--iso", "0", "--method", "delaunay", "--quiet"};
        words.insert(words.end(), bounds.begin(), bounds.end());
        good(words);
        return bytes("d.ply");
    };
    EXPECT_EQ(surface({"--radius", "1.5", "--distance", "1"}),
              surface({"--radius", "3A", "--distance", "2A"}));
    EXPECT_NE(surface({"--radius", "1.5"}), surface({"--radius", "1.5A"}));
    expect_error(vdbgeo({"surface", map, at("e.ply"), "--radius", "2px"}), 2, "--radius: '2px'");
    expect_error(vdbgeo({"surface", map, at("e.ply"), "--distance", "-1"}), 2, "--distance: '-1'");
    expect_error(vdbgeo({"surface", map, at("e.ply"), "--iso", "0", "--method", "delaunay", "--max-vertices",
                         "50", "--quiet"}),
                 5, map + ": ", "50");
    EXPECT_FALSE(listing().count("e.ply"));
}

TEST_F(Surfaces, CapsCloseWhatTheBorderCuts) {
    // A gyroid runs out of its box on all sides.
    const std::string map = phantom("g.mrc", 40, {}, "gyroid");
    const Json open = json({"surface", map, at("open.ply"), "--iso", "0"});
    EXPECT_EQ(open["closed"], false);
    const Json capped = json({"surface", map, at("capped.ply"), "--iso", "0", "--cap"});
    expect_sound(capped);
    EXPECT_GT(capped["volume_A3"].get<double>(), 0);
    // Caps are no part of the area.
    EXPECT_NEAR(capped["area_A2"].get<double>(), open["area_A2"].get<double>(),
                1e-6 * open["area_A2"].get<double>());
    EXPECT_GT(capped["cap_area_A2"].get<double>(), 0);
    expect_error(vdbgeo({"surface", map, at("x.ply"), "--cap", "--method", "dual"}), 2, "--cap");
}

TEST_F(Surfaces, IsovaluesByRules) {
    const std::string map = phantom("a.mrc", 40, {"--snr", "100", "--seed", "1"});
    const Json by_volume = json({"surface", map, at("v.ply"), "--iso", "volume:2e6"});
    EXPECT_NEAR(by_volume["volume_A3"].get<double>(), 2e6, 0.03 * 2e6);
    const Json by_mass = json({"surface", map, at("m.ply"), "--iso", "mass:1.6260163MDa"});
    EXPECT_NEAR(by_mass["iso"].get<double>(), by_volume["iso"].get<double>(), 1e-3);
    json({"surface", map, at("o.ply"), "--iso", "otsu"});
    make("record.json",
         R"({"map": {"contour_list": {"contour": [{"primary": true, "level": 0.25, "source": "AUTHOR"}]}}})");
    EXPECT_EQ(json({"surface", map, at("r.ply"), "--iso", "record:" + at("record.json")})["iso"], 0.25);
    expect_error(vdbgeo({"surface", map, at("x.ply"), "--iso", "record:" + at("none.json")}), 4,
                 at("none.json"));
    expect_error(vdbgeo({"surface", map, at("x.ply"), "--iso", "volume:-1", "--quiet"}), 3, map, "volume:-1");
    expect_error(vdbgeo({"surface", map, at("x.ply"), "--iso", "volume:1e12", "--quiet"}), 3, map);
    EXPECT_FALSE(listing().count("x.ply"));
}

TEST_F(Surfaces, InfoListsIsovalues) {
    const std::string map = phantom("a.mrc", 40);
    const Json j = json({"info", map, "--isovalues", "--plot", at("levels.png")});
    ASSERT_GE(j["isovalues"].size(), 4u);
    double last = -1;
    for (const Json& row : j["isovalues"]) {
        for (const char* key : {"isovalue", "sigmas", "volume_A3", "area_A2", "components"})
            EXPECT_TRUE(row.contains(key)) << key;
        EXPECT_GT(row["volume_A3"].get<double>(), last);  // from high to low
        last = row["volume_A3"].get<double>();
    }
    EXPECT_EQ(bytes("levels.png").substr(1, 3), "PNG");
    expect_error(vdbgeo({"info", map, "--plot", at("x.png")}), 2, "--plot");
    expect_error(vdbgeo({"info", map, "--isovalues", "--plot", at("x.svgz")}), 2, at("x.svgz"));
}

TEST_F(Surfaces, PiecesAreListedKeptAndSplit) {
    TriMesh three = joined(moved(icosphere(3, 10), vdbgeo::Mat3d::Identity(), {-30, 0, 0}), icosphere(2, 3));
    three =
        joined(three, moved(flipped(icosphere(2, 5)), vdbgeo::Mat3d::Identity(), {-30, 0, 0}));  // a cavity
    const std::string file = mesh("three.ply", three);
    const Json listed = json({"components", file});
    EXPECT_EQ(listed["components"], 3);
    EXPECT_EQ(listed["cavities"], 1);
    const Json kept = json({"components", file, at("one.ply"), "--keep-largest", "1"});
    EXPECT_EQ(kept["components"], 2);  // the shell and its cavity
    EXPECT_EQ(json({"components", file, at("two.ply"), "--min-volume", "200"})["components"], 2);
    EXPECT_EQ(json({"components", file, at("solid.ply"), "--drop-cavities"})["cavities"], 0);
    const Json split = json({"components", file, at("part.ply"), "--split"});
    EXPECT_EQ(split["files"].size(), 3u);
    for (const char* name : {"part_0001.ply", "part_0002.ply", "part_0003.ply"})
        EXPECT_EQ(json({"measure", at(name)})["components"], 1) << name;
    expect_error(vdbgeo({"components", file, "--split"}), 2, "--split");
    const std::string map = phantom("a.mrc", 24);
    expect_error(vdbgeo({"surface", map, at("x.ply"), "--iso", "0", "--min-area", "1e9", "--quiet"}), 5, map,
                 "no piece");
}

TEST_F(Surfaces, LabelsBecomeSmoothClosedSurfaces) {
    const int n = 24;
    std::vector<float> values(static_cast<std::size_t>(n * n * n), 0.f);
    const auto at_voxel = [&](int x, int y, int z) -> float& {
        return values[static_cast<std::size_t>((z * n + y) * n + x)];
    };
    for (int z = 6; z < 18; ++z)
        for (int y = 6; y < 18; ++y)
            for (int x = 4; x < 20; ++x) at_voxel(x, y, z) = x < 12 ? 1.f : 3.f;
    vdbgeo::write_mrc(map_from_values({n, n, n}, values), folder_ / "labels.mrc");
    const Json j = json({"surface", at("labels.mrc"), at("l.ply"), "--labels", "all"});
    ASSERT_EQ(j["labels"].size(), 2u);
    EXPECT_EQ(j["labels"][0]["label"], 1);
    EXPECT_EQ(j["labels"][1]["label"], 3);
    for (const Json& row : j["labels"]) EXPECT_EQ(row["components"], 1);
    expect_sound(j);
    EXPECT_NE(vdbgeo::read_mesh(at("l.ply")).find_face_property("label"), nullptr);
    EXPECT_EQ(json({"surface", at("labels.mrc"), at("m.ply"), "--labels", "3"})["labels"].size(), 1u);
    expect_error(vdbgeo({"surface", at("labels.mrc"), at("x.ply"), "--labels", "7", "--quiet"}), 3,
                 at("labels.mrc"), "label 7");
    expect_error(vdbgeo({"surface", at("labels.mrc"), at("x.ply"), "--labels", "some"}), 2, "--labels");
    expect_error(vdbgeo({"surface", phantom("a.mrc", 24), at("x.ply"), "--labels", "all", "--quiet"}), 3,
                 at("a.mrc"), "segmentation");
}

TEST_F(Surfaces, RemeshMakesGoodTriangles) {
    const std::string map = phantom("a.mrc", 40);
    good({"surface", map, at("mc.ply"), "--iso", "0", "--quiet"});
    const Json j = json({"remesh", at("mc.ply"), at("even.ply"), "--length", "3"});
    expect_sound(j);
    EXPECT_GT(j["min_angle_deg"].get<double>(), 20);
    EXPECT_GT(j["hausdorff_A"].get<double>(), 0);
    EXPECT_LT(j["hausdorff_A"].get<double>(), 3);
    EXPECT_EQ(j["method"], "isotropic");
    EXPECT_EQ(json({"remesh", at("mc.ply"), at("c.ply"), "--adaptive", "--error", "0.2"})["method"],
              "adaptive");
    if (vdbgeo::have_delaunay()) {
        const Json d = json({"remesh", at("mc.ply"), at("d.ply"), "--method", "delaunay", "--radius", "3"});
        EXPECT_GE(d["min_angle_deg"].get<double>(), 30 - 1e-3);
    }
    expect_error(vdbgeo({"remesh", at("mc.ply"), at("x.ply"), "--length", "-1"}), 2, "");
}

TEST_F(Surfaces, SimplifyReachesTheCountAndTheBound) {
    const std::string sphere = mesh("s.ply", icosphere(5, 50));
    const Json j = json({"simplify", sphere, at("a.ply"), "--faces", "2000"});
    expect_sound(j);
    EXPECT_LE(j["faces"].get<int>(), 2000);
    EXPECT_GE(j["faces"].get<int>(), 1900);
    EXPECT_LE(json({"simplify", sphere, at("b.ply"), "--ratio", "0.1"})["faces"].get<int>(), 2048);
    const Json near = json({"simplify", sphere, at("c.ply"), "--max-distance", "0.5"});
    EXPECT_LE(near["hausdorff_A"].get<double>(), 0.5);
    EXPECT_LT(near["faces"].get<int>(), 20480 / 4);
    expect_error(vdbgeo({"simplify", sphere, at("x.ply")}), 2, "");
    expect_error(vdbgeo({"simplify", sphere, at("x.ply"), "--faces", "9", "--ratio", "0.1"}), 2, "--faces");
}

TEST_F(Surfaces, SmoothKeepsTheVolume) {
    const std::string sphere = mesh("s.ply", icosphere(4, 30));
    for (const Words& how :
         std::vector<Words>{{"--iterations", "20"}, {"--method", "diffusion", "--time", "5"}}) {
        Words words{"smooth", sphere, at("a.ply")};
        words.insert(words.end(), how.begin(), how.end());
        const Json j = json(words);
        EXPECT_NEAR(j["volume_A3"].get<double>() / j["volume_before_A3"].get<double>(), 1, 0.01);
    }
    expect_error(vdbgeo({"smooth", sphere, at("x.ply"), "--method", "diffusion"}), 2, "--method diffusion");
}

TEST_F(Surfaces, RepairTellsWhatItDidAndStagesRefuseByName) {
    TriMesh m = icosphere(3, 10);
    m.triangles.resize(m.triangles.size() - 3);                                        // a hole
    m.triangles.push_back({m.triangles[0][0], m.triangles[0][1], m.triangles[0][2]});  // a double face
    const std::string bad = mesh("bad.ply", m);
    expect_error(vdbgeo({"remesh", bad, at("x.ply"), "--quiet"}), 3, bad + ": remesh needs");
    expect_error(vdbgeo({"simplify", bad, at("x.ply"), "--faces", "100", "--quiet"}), 3,
                 bad + ": simplify needs");
    const Json j = json({"repair", bad, at("good.ply")});
    expect_sound(j);
    EXPECT_EQ(j["repaired"]["duplicate_faces"], 1);
    EXPECT_GE(j["repaired"]["filled_holes"].get<int>(), 1);
    good({"remesh", at("good.ply"), at("x.ply"), "--quiet"});
    const Json open = json({"repair", bad, at("open.ply"), "--keep-holes"});
    EXPECT_EQ(open["closed"], false);
    if (vdbgeo::have_self_intersections()) {
        const TriMesh crossing =
            joined(icosphere(2, 10), moved(icosphere(2, 10), vdbgeo::Mat3d::Identity(), {9, 1, 2}));
        EXPECT_GT(json({"info", mesh("cross.ply", crossing)})["self_intersections"].get<int>(), 0);
    }
}

TEST_F(Surfaces, SameBytesForAnyNumberOfThreads) {
    const std::string map = phantom("a.mrc", 40, {"--snr", "5", "--seed", "3"}, "clathrin-cage");
    std::vector<Words> runs{
        {"surface", map, "OUT", "--cap"}, {"surface", map, "OUT", "--method", "dual"},
        {"remesh", at("mc.ply"), "OUT"},  {"simplify", at("mc.ply"), "OUT", "--ratio", "0.2"},
        {"smooth", at("mc.ply"), "OUT"},  {"repair", at("mc.ply"), "OUT"}};
    if (vdbgeo::have_delaunay()) runs.push_back({"surface", map, "OUT", "--method", "delaunay"});
    good({"surface", map, at("mc.ply"), "--quiet"});
    for (Words words : runs) {
        for (const char* threads : {"1", "2"}) {
            words[2] = at(std::string("out") + threads + ".ply");
            Words run = words;
            for (const char* more : {"--quiet", "--threads", threads}) run.push_back(more);
            good(run);
        }
        EXPECT_TRUE(bytes("out1.ply") == bytes("out2.ply")) << joined(words);
    }
}

TEST_F(Surfaces, HistogramOfSeveralMeshes) {
    const std::string a = mesh("a.ply", icosphere(3, 10)), b = mesh("b.ply", torus_mesh(10, 3));
    const Json j = json({"measure", a, b, "--histogram", at("h.png")});
    ASSERT_EQ(j["files"].size(), 2u);
    for (const Json& m : j["files"])
        for (const char* key : {"radius_edge_max", "radius_edge_mean", "below_30_percent", "angle_histogram"})
            EXPECT_TRUE(m.contains(key)) << key;
    EXPECT_EQ(bytes("h.png").substr(1, 3), "PNG");
}

TEST_F(Surfaces, MeasuresOfAMeshLargerThanMemory) {
    const std::string map = phantom("n.mrc", 128, {"--snr", "0.05"}, "atpase");
    good({"surface", map, at("n.ply"), "--iso", "0", "--quiet"});
    const Json whole = json({"measure", at("n.ply")});
    EXPECT_GT(whole["faces"].get<std::uint64_t>(), 3000000u);
    const Ended r = good({"measure", at("n.ply"), "--memory", "150M", "--json", "--quiet"});
    Json parts = Json::parse(r.out, nullptr, false);
    parts["seconds"] = whole["seconds"];
    EXPECT_EQ(parts, whole);
    if (!sanitized) {
        EXPECT_LT(r.peak_bytes, std::uint64_t(150) << 20);
    }
    expect_error(vdbgeo({"measure", at("n.ply"), "--memory", "40M", "--quiet"}), 5, at("n.ply"),
                 "does not fit");
    expect_error(vdbgeo({"measure", at("n.ply"), "--memory", "much"}), 2, "--memory");
}

TEST_F(Surfaces, DistanceBetweenTwoMeshes) {
    const std::string a = mesh("a.ply", icosphere(4, 10)), b = mesh("b.ply", icosphere(4, 11));
    const Json j = json({"measure", a, "--distance", b});
    EXPECT_NEAR(j["hausdorff_A"].get<double>(), 1, 0.02);
    EXPECT_NEAR(j["distance_forward"]["rms_A"].get<double>(), 1, 0.02);
    EXPECT_LT(json({"measure", a, "--distance", a})["hausdorff_A"].get<double>(), 1e-9);
    expect_error(vdbgeo({"measure", a, b, "--distance", b}), 2, "--distance");
}

TEST_F(Surfaces, FlagsOfAnotherMethodAreRefused) {
    const std::string map = phantom("a.mrc", 16), sphere = mesh("s.ply", icosphere(2, 10)), out = at("x.ply");
    const std::vector<std::pair<Words, std::string>> wrong{
        {{"surface", map, out, "--iso", "0", "--surface-mask", map}, "--surface-mask"},
        {{"surface", map, out, "--iso", "0", "--angle", "20"}, "--angle"},
        {{"surface", map, out, "--iso", "0", "--method", "delaunay", "--adaptivity", "1"}, "--adaptivity"},
        {{"surface", map, out, "--label-iterations", "3"}, "--label-iterations"},
        {{"surface", map, out, "--labels", "all", "--iso", "1"}, "--iso"},
        {{"remesh", sphere, out, "--error", "0.1"}, "--error"},
        {{"remesh", sphere, out, "--adaptive", "--length", "1"}, "--length"},
        {{"remesh", sphere, out, "--radius", "1"}, "--radius"},
        {{"smooth", sphere, out, "--time", "1"}, "--time"},
        {{"smooth", sphere, out, "--method", "diffusion", "--time", "1", "--lambda", "0.4"}, "--lambda"}};
    for (const auto& [words, flag] : wrong) {
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 2, flag);
    }
    EXPECT_FALSE(listing().count("x.ply"));
}
