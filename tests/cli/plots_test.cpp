// Plots of the commands: PNG and SVG, what is written in them, where their marks are.
#include <sstream>

#include "converters/tet_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/tet_meshes.h"

using namespace vdbgeo::test;

namespace {

constexpr const char* python = "/usr/bin/python3";

/// Prints the texts of an SVG file as a JSON array; fails where it is not well-formed, or is no SVG.
constexpr const char* read_svg = R"(
import json, sys, xml.etree.ElementTree as tree
root = tree.parse(sys.argv[1]).getroot()
space = '{http://www.w3.org/2000/svg}'
assert root.tag == space + 'svg' and root.get('role') == 'img' and root.get('aria-label')
assert root.find(space + 'title').text == root.get('aria-label')
assert root.get('viewBox') == '0 0 ' + root.get('width') + ' ' + root.get('height')
classes = {e.get('class') for e in root.iter()}
assert classes <= {None, 'ink-text', 'ink-line', 'grid', 'paper'}, classes
print(json.dumps([e.text for e in root.iter(space + 'text')]))
)";

class Plots : public Cli {
 protected:
    std::set<std::string> texts_in(const std::string& name) const {
        const Ended r = run({python, "-c", read_svg, at(name)});
        EXPECT_EQ(r.code, 0) << name << ": " << r.err;
        const Json j = Json::parse(r.out, nullptr, false);
        std::set<std::string> texts;
        for (const Json& text : j.is_array() ? j : Json::array()) texts.insert(text.get<std::string>());
        return texts;
    }

    void expect_texts(const std::string& name, const std::set<std::string>& expected) const {
        const auto found = texts_in(name);
        std::string all;
        for (const std::string& text : found) all += "\n  " + text;
        for (const std::string& text : expected)
            EXPECT_TRUE(found.count(text)) << name << ": " << text << all;
    }

    void expect_png(const std::string& name) const {
        EXPECT_EQ(bytes(name).substr(1, 3), "PNG") << name;
        EXPECT_GT(bytes(name).size(), 3000u) << name;
    }
};

bool have_python() { return std::filesystem::exists(python); }

}  // namespace

TEST_F(Plots, DensitiesAndIsovaluesOfAMap) {
    const std::string map = phantom("a.mrc", 32, {"--snr", "2"}, "virus");
    const Json j = json({"info", map, "--histogram", at("d.svg"), "--iso", "0.5", "--isovalues", "--plot",
                         at("i.svg"), "--dark"});
    EXPECT_EQ(j["iso"], 0.5);
    const Json& h = j["density_histogram"];
    EXPECT_EQ(h["voxels"], 32 * 32 * 32);
    EXPECT_NEAR(h["low"].get<double>(), j["min"].get<double>(), 1e-6);
    EXPECT_NEAR(h["high"].get<double>(), j["max"].get<double>(), 1e-6);
    std::uint64_t sum = 0;
    for (const Json& c : h["counts"]) sum += c.get<std::uint64_t>();
    EXPECT_EQ(sum, 32u * 32 * 32);
    EXPECT_FALSE(j["isovalues"].empty());
    if (have_python()) {
        expect_texts("d.svg", {"Densities of a.mrc", "density (the map's units)", "voxels a bin", "10²"});
        expect_texts("i.svg", {"volume (Å³)", "area (Å²)", "pieces", "isovalue (the map's units)"});
        for (const char* name : {"d.svg", "i.svg"}) {
            const auto found = texts_in(name);
            EXPECT_EQ(
                std::count_if(found.begin(), found.end(),
                              [](const std::string& t) { return t.rfind("isovalue 0.5 (mean + ", 0) == 0; }),
                1)
                << name;
        }
    }
    good({"info", map, "--histogram", at("d.png"), "--quiet"});
    expect_png("d.png");
    EXPECT_FALSE(json({"info", map, "--histogram", at("d.png")}).contains("iso"));
    // Of a sparse grid the active voxels alone.
    good({"convert", map, at("s.vdb"), "--threshold", "0.5", "--quiet"});
    const Json sparse = json({"info", at("s.vdb"), "--histogram", at("s.svg")});
    EXPECT_EQ(sparse["density_histogram"]["voxels"], sparse["active_voxels"]);
}

TEST_F(Plots, NamesOfFilesAreEscaped) {
    if (!have_python()) GTEST_SKIP() << "NOT TESTED: python3 is not installed";
    const std::string map = phantom("a <b> & \"c\".mrc", 24);
    good({"info", map, "--histogram", at("d.svg"), "--quiet"});
    expect_texts("d.svg", {"Densities of a <b> & \"c\".mrc"});
    std::filesystem::copy(map, at("bad \xff\x07.mrc"));
    good({"info", at("bad \xff\x07.mrc"), "--histogram", at("d.svg"), "--quiet"});
    expect_texts("d.svg", {"Densities of bad \ufffd\ufffd.mrc"});
}

TEST_F(Plots, AnglesOfMeshes) {
    const std::string map = phantom("a.mrc", 24);
    good({"surface", map, at("a.ply"), "--iso", "0", "--quiet"});
    good({"remesh", at("a.ply"), at("b.ply"), "--quiet"});
    good({"measure", at("a.ply"), "--histogram", at("one.svg"), "--quiet"});
    good({"measure", at("a.ply"), at("b.ply"), "--histogram", at("two.svg"), "--dark", "--quiet"});
    good({"measure", at("a.ply"), at("b.ply"), "--histogram", at("two.png"), "--quiet"});
    expect_png("two.png");
    if (!have_python()) return;
    expect_texts("one.svg", {"Angles of the triangles", "angle (°)", "angles a degree"});
    expect_texts("two.svg", {"Angles of the triangles", "angle (°)", "share of the angles (% a degree)",
                             "a.ply", "b.ply"});
    EXPECT_NE(bytes("two.svg").find("class=\"paper\" width=\"1000\" height=\"640\" fill=\"#131519\""),
              std::string::npos);
}

TEST_F(Plots, CurvatureAndItsPlane) {
    const std::string map = phantom("a.mrc", 32, {}, "torus");
    good({"surface", map, at("a.ply"), "--iso", "0", "--quiet"});
    good({"curvature", at("a.ply"), at("c.ply"), "--map", map, "--histogram", at("k.svg"), "--plane",
          at("p.svg"), "--quiet"});
    good({"curvature", at("a.ply"), at("c.ply"), "--map", map, "--histogram", at("k.png"), "--plane",
          at("p.png"), "--dark", "--quiet"});
    expect_png("k.png");
    expect_png("p.png");
    if (!have_python()) return;
    expect_texts("k.svg", {"Curvature over the surface", "curvature (1/Å)", "share of the area (% a bin)",
                           "k1", "k2", "H"});
    // A torus: no pit, no valley, and k1 is above −k2 everywhere.
    expect_texts("p.svg", {"Principal curvatures over the surface", "k1, the greater one (1/Å)",
                           "k2, the smaller one (1/Å)", "share of the area (% a cell)", "peak", "ridge",
                           "saddle ridge", "flat"});
}

TEST_F(Plots, DihedralsAndSpectra) {
    vdbgeo::write_tets(ball_tets(10, 3), at("t.vtu"));
    good({"cutaway", at("t.vtu"), at("o.ply"), "--histogram", at("d.svg"), "--quiet"});
    const std::string map = phantom("a.mrc", 32, {"--snr", "1"}, "virus");
    const Json j = json({"denoise", map, at("b.mrc"), "--time", "2", "--spectra", at("s.svg")});
    EXPECT_EQ(j["spectra"], at("s.svg"));
    EXPECT_FALSE(j.contains("preview"));
    good({"denoise", map, at("b.mrc"), "--time", "2", "--spectra", at("s.png"), "--dark", "--quiet"});
    expect_png("s.png");
    if (!have_python()) return;
    expect_texts("d.svg", {"Dihedral angles of the tetrahedra", "dihedral angle (°)", "angles a degree"});
    expect_texts("s.svg", {"Radial power spectrum", "spatial frequency (1/Å)",
                           "power (the map's units squared)", "before", "after"});
}

TEST_F(Plots, TheSameBytesForAnyNumberOfThreads) {
    const std::string map = phantom("a.mrc", 40, {"--snr", "2"}, "virus");
    good({"surface", map, at("a.ply"), "--iso", "0.5", "--quiet"});
    std::string first;
    for (const char* threads : {"1", "2"}) {
        good({"info", map, "--histogram", at("d.svg"), "--iso", "otsu", "--threads", threads, "--quiet"});
        good({"curvature", at("a.ply"), at("c.ply"), "--plane", at("p.svg"), "--histogram", at("k.png"),
              "--threads", threads, "--quiet"});
        good({"denoise", map, at("b.mrc"), "--time", "1", "--spectra", at("s.svg"), "--threads", threads,
              "--quiet"});
        const std::string all = bytes("d.svg") + bytes("p.svg") + bytes("k.png") + bytes("s.svg");
        if (first.empty()) first = all;
        EXPECT_TRUE(all == first) << threads;
    }
}

TEST_F(Plots, OtherEndingsAndFlagsWithoutAPlotAreRefused) {
    const std::string map = phantom("a.mrc", 24);
    good({"surface", map, at("a.ply"), "--iso", "0", "--quiet"});
    const std::string mesh = at("a.ply");
    const auto before = listing();
    const std::vector<Words> calls{{"info", map, "--histogram"},
                                   {"info", map, "--isovalues", "--plot"},
                                   {"measure", mesh, "--histogram"},
                                   {"curvature", mesh, at("c.ply"), "--histogram"},
                                   {"curvature", mesh, at("c.ply"), "--plane"},
                                   {"tetrahedralize", map, at("t.vtu"), "--iso", "0", "--histogram"},
                                   {"denoise", map, at("b.mrc"), "--time", "1", "--spectra"}};
    for (const char* name : {"x.pdf", "x.svgz", "x", ".svg"})
        for (Words words : calls) {
            words.push_back(name == std::string(".svg") ? name : at(name));
            expect_error(vdbgeo(words), 2, words.back() + ": plots are .png or .svg");
        }
    for (const Words& words : std::vector<Words>{{"info", map, "--dark"},
                                                 {"measure", mesh, "--dark"},
                                                 {"curvature", mesh, at("c.ply"), "--dark"},
                                                 {"tetrahedralize", map, at("t.vtu"), "--dark"},
                                                 {"denoise", map, at("b.mrc"), "--dark"}})
        expect_error(vdbgeo(words), 2, "--dark: ");
    expect_error(vdbgeo({"info", map, "--iso", "1"}), 2, "--iso: ");
    expect_error(vdbgeo({"info", map, "--histogram", at("x.svg"), "--iso", "much"}), 2, "--iso: ");
    expect_error(vdbgeo({"info", map, map, "--histogram", at("x.svg")}), 2, "--histogram");
    expect_error(vdbgeo({"info", mesh, "--histogram", at("x.svg")}), 2, mesh);
    expect_error(vdbgeo({"info", map, "--histogram", at("none/x.svg"), "--quiet"}), 4, at("none/x.svg"));
    EXPECT_EQ(listing(), before);
}
