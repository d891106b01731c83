// vdbgeo pockets: tables, marked meshes and pictures.
#include <cmath>
#include <sstream>

#include "converters/mesh_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/meshes.h"
#include "vdbgeo/measure/convex_hull.h"

using namespace vdbgeo::test;
using vdbgeo::MeshProperty;
using vdbgeo::TriMesh;
using vdbgeo::Vec3f;

namespace {

class PocketsCommand : public Cli {
 protected:
    /// A torus whose vertices say that it is hollow on two sides, at x = ±25, and pointed at y = ±25.
    std::string mesh(const std::string& name, bool marked = true) const {
        TriMesh m = torus_mesh(25, 10);
        MeshProperty k1{"k1", 1, {}}, k2{"k2", 1, {}};
        for (const Vec3f& p : m.points) {
            const double x = double(std::abs(p.x())) - 25, y = double(p.y()), z = double(p.z());
            const bool hollow = x * x + y * y + z * z < (p.x() > 0 ? 144 : 121);
            const double u = double(p.x()), v = double(std::abs(p.y())) - 25;
            const bool pointed = u * u + v * v + z * z < 144;
            k1.values.push_back(pointed ? 0.5f : 0.05f);
            k2.values.push_back(hollow ? -0.3f : 0.05f);
        }
        if (marked) m.vertex_properties = {k1, k2};
        vdbgeo::write_mesh(m, folder_ / name);
        return at(name);
    }
    /// What gives depths in a build without CGAL too.
    static Words with_ball(Words words) {
        words.insert(words.end(), {"--ambient-radius", "30"});
        return words;
    }
};

std::vector<Words> table(const std::string& text) {
    std::vector<Words> rows;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        rows.emplace_back();
        std::istringstream cells(line);
        for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
    }
    return rows;
}

}  // namespace

TEST_F(PocketsCommand, WritesTheSameTableAsCsvAndJson) {
    const std::string in = mesh("a.ply");
    const Json j = json(with_ball({"pockets", in, at("a.csv")}));
    EXPECT_EQ(j["curvature"], "of the file");
    EXPECT_EQ(j["kind"], "pocket");
    EXPECT_EQ(j["pockets"], 2);
    EXPECT_EQ(j["depth_below"], "ball");
    EXPECT_EQ(j["ambient_radius_A"], 30);
    EXPECT_LT(j["threshold_per_A"].get<double>(), 0);
    for (const char* key : {"file", "k1_below_per_A", "min_area_A2", "min_persistence_per_A", "area_A2",
                            "surface_area_A2", "listed", "seconds"})
        EXPECT_TRUE(j.contains(key)) << key;
    const auto rows = table(bytes("a.csv"));
    ASSERT_EQ(rows.size(), 3u);
    const Words names{"id",
                      "kind",
                      "vertices",
                      "area_A2",
                      "centroid_x_A",
                      "centroid_y_A",
                      "centroid_z_A",
                      "mean_k1_per_A",
                      "mean_k2_per_A",
                      "mean_H_per_A",
                      "mean_K_per_A2",
                      "extreme_k_per_A",
                      "extreme_vertex",
                      "depth_A",
                      "mean_depth_A",
                      "rims",
                      "mouth_length_A",
                      "mouth_area_A2",
                      "opening_x",
                      "opening_y",
                      "opening_z",
                      "touches_border",
                      "score"};
    EXPECT_EQ(rows[0], names);
    json(with_ball({"pockets", in, at("a.json")}));
    const Json whole = Json::parse(bytes("a.json"));
    ASSERT_EQ(whole["list"].size(), 2u);
    EXPECT_EQ(whole["list"], j["listed"]);
    for (std::size_t r = 0; r < 2; ++r) {
        ASSERT_EQ(rows[r + 1].size(), names.size());
        EXPECT_EQ(rows[r + 1][0], std::to_string(r + 1));
        EXPECT_EQ(rows[r + 1][1], "pocket");
        for (std::size_t c = 2; c < names.size(); ++c)
            EXPECT_EQ(Json::parse(rows[r + 1][c]), whole["list"][r][names[c]]) << names[c];
        EXPECT_NEAR(whole["list"][r]["mean_k2_per_A"].get<double>(), -0.3, 1e-6);
        EXPECT_NEAR(std::abs(whole["list"][r]["centroid_x_A"].get<double>()), 25, 3);
        EXPECT_EQ(whole["list"][r]["touches_border"], false);
    }
    // The same for any threads, and on a pipe.
    good(with_ball({"pockets", in, at("b.csv"), "-j", "1", "-q"}));
    EXPECT_EQ(bytes("a.csv"), bytes("b.csv"));
    EXPECT_EQ(good(with_ball({"pockets", in, "-", "-q"})).out, bytes("a.csv"));
}

TEST_F(PocketsCommand, DepthBelowTheHull) {
    const vdbgeo::test::Ended r = vdbgeo({"pockets", mesh("a.ply"), at("a.csv"), "--json", "-q"});
    if (!vdbgeo::have_convex_hull()) {
        expect_error(r, 3, at("a.ply"), "CGAL");
        EXPECT_FALSE(listing().count("a.csv"));
        return;
    }
    EXPECT_EQ(r.code, 0) << r.err;
    const Json j = Json::parse(r.out);
    EXPECT_EQ(j["depth_below"], "hull");
    EXPECT_TRUE(j["ambient_radius_A"].is_null());
    // The inner side of a torus is its tube's radius below the hull.
    EXPECT_NEAR(j["listed"][0]["depth_A"].get<double>(), 10, 0.05);
}

TEST_F(PocketsCommand, MarksTheMesh) {
    const std::string in = mesh("a.ply");
    const Json j = json(with_ball({"pockets", in, at("a.csv"), "--mesh", at("b.ply"), "--list", "1"}));
    EXPECT_EQ(j["listed"].size(), 1u);
    EXPECT_EQ(j["pockets"], 2);
    const TriMesh marked = vdbgeo::read_mesh(folder_ / "b.ply");
    const MeshProperty* id = marked.find_vertex_property("pocket");
    ASSERT_TRUE(id);
    EXPECT_TRUE(marked.find_vertex_property("k2"));
    const auto rows = table(bytes("a.csv"));
    for (const float number : {1.f, 2.f})
        EXPECT_EQ(std::to_string(std::count(id->values.begin(), id->values.end(), number)),
                  rows[std::size_t(number)][2]);
    // The property is replaced, and protrusions have one of their own.
    json(with_ball({"pockets", at("b.ply"), at("c.csv"), "--mesh", at("b.ply"), "--k2-below", "-1"}));
    json(with_ball({"pockets", at("b.ply"), at("c.json"), "--mesh", at("b.ply"), "--protrusions"}));
    const TriMesh twice = vdbgeo::read_mesh(folder_ / "b.ply");
    std::size_t found = 0;
    for (const MeshProperty& p : twice.vertex_properties) found += p.name == "pocket";
    EXPECT_EQ(found, 1u);
    for (const float v : twice.find_vertex_property("pocket")->values) EXPECT_EQ(v, 0);
    ASSERT_TRUE(twice.find_vertex_property("protrusion"));
    const Json tips = Json::parse(bytes("c.json"));
    EXPECT_EQ(tips["protrusions"], 2);
    EXPECT_EQ(tips["list"][0]["kind"], "protrusion");
    EXPECT_FALSE(tips.contains("k1_below_per_A"));
    EXPECT_EQ(table(bytes("c.csv")).size(), 1u);
}

TEST_F(PocketsCommand, TakesItsBounds) {
    const std::string in = mesh("a.ply");
    const auto count = [&](Words flags) {
        flags.insert(flags.begin(), {"pockets", in, at("x.csv")});
        const Json j = json(with_ball(flags));
        return j["kind"] == "pocket" ? j["pockets"] : j["protrusions"];
    };
    EXPECT_EQ(count({"--k2-below", "-0.31"}), 0);
    EXPECT_EQ(count({"--k2-below", "-0.2"}), 2);
    EXPECT_EQ(count({"--k1-below", "0.01"}), 0);
    EXPECT_EQ(count({"--k1-below", "inf"}), 2);
    EXPECT_EQ(count({"--min-area", "1e6"}), 0);
    EXPECT_EQ(count({"--min-persistence", "inf"}), 2);
    EXPECT_EQ(count({"--protrusions", "--k1-above", "0.6"}), 0);
    EXPECT_EQ(count({"--protrusions", "--k1-above", "0.3"}), 2);
}

TEST_F(PocketsCommand, ComputesCurvatureThatTheFileHasNot) {
    // A torus has no pocket, whatever its vertices say.
    for (const Words& words : {Words{"pockets", mesh("plain.ply", false), at("a.csv")},
                               Words{"pockets", mesh("lies.ply"), at("a.csv"), "--recompute"}}) {
        const Json j = json(words);
        EXPECT_EQ(j["curvature"], "computed");
        EXPECT_EQ(j["pockets"], 0);
        EXPECT_EQ(table(bytes("a.csv")).size(), 1u);
    }
}

TEST_F(PocketsCommand, DrawsAPicture) {
    const Words words{"pockets", mesh("a.ply"), at("a.csv"), "--picture", at("a.png"), "--width", "200"};
    good(with_ball(words));
    EXPECT_EQ(bytes("a.png").substr(1, 3), "PNG");
    // No pocket is a picture too.
    good(with_ball({"pockets", mesh("a.ply"), at("b.csv"), "--picture", at("b.png"), "--width", "200",
                    "--k2-below", "-1"}));
    EXPECT_EQ(bytes("b.png").substr(1, 3), "PNG");
}

TEST_F(PocketsCommand, RefusesWhatMakesNoSense) {
    const std::string in = mesh("a.ply");
    const auto refuse = [&](Words flags, const std::string& text, const std::string& out = "a.csv") {
        flags.insert(flags.begin(), {"pockets", in, at(out)});
        const vdbgeo::test::Ended r = vdbgeo(flags);
        expect_error(r, 2, "", text);
    };
    refuse({}, "tables are .csv or .json", "a.txt");
    refuse({"--protrusions", "--k2-below", "-1"}, "--k2-below");
    refuse({"--protrusions", "--k1-below", "1"}, "--k1-below");
    refuse({"--k1-above", "1"}, "--k1-above");
    refuse({"--k2-below", "nan"}, "the bound on k2");
    refuse({"--min-area", "-1"}, "the least area");
    refuse({"--ambient-radius", "0"}, "the ball's radius");
    refuse({"--mesh", at("b.xyz")}, "b.xyz");
    refuse({"--picture", at("b.jpg")}, "b.jpg");
    refuse({"--width", "200"}, "--picture");
    expect_error(vdbgeo({"pockets", in, "-", "--json"}), 2, "");
    expect_error(vdbgeo({"pockets", in, at("a.csv"), "--ambient-radius", "0.001", "-q"}), 3, in, "too small");
    expect_error(vdbgeo({"pockets", at("none.ply"), at("a.csv")}), 4, at("none.ply"));
    EXPECT_EQ(listing(), (std::set<std::string>{"a.ply"}));
}

TEST_F(PocketsCommand, MeansOfOtherValuesOfTheVertices) {
    TriMesh m = vdbgeo::read_mesh(mesh("plain.ply"));
    MeshProperty x{"x_position", 1, {}};
    for (const Vec3f& p : m.points) x.values.push_back(p.x());
    m.vertex_properties.push_back(x);
    vdbgeo::write_mesh(m, folder_ / "sampled.ply");
    const Json j = json(with_ball({"pockets", at("sampled.ply"), at("s.csv")}));
    ASSERT_EQ(j["listed"].size(), 2u);
    for (const Json& row : j["listed"])
        EXPECT_NEAR(row["mean_x_position"].get<double>(), row["centroid_x_A"].get<double>(), 1e-4);
    const auto rows = table(bytes("s.csv"));
    ASSERT_EQ(rows.size(), 3u);
    EXPECT_EQ(rows[0].back(), "mean_x_position");
}
