// vdbgeo report on the folders of runs: whole ones, aborted ones, damaged ones, and none.
#include <algorithm>
#include <filesystem>

#include "converters/mesh_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/html.h"
#include "tests/support/meshes.h"
#include "vdbgeo/core/tri_mesh.h"

using namespace vdbgeo::test;
namespace fs = std::filesystem;

namespace {

const std::string plot =
    "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 9 9\" role=\"img\" "
    "aria-label=\"Plot\"><title>Plot</title>"
    "<path class=\"ink-line\" d=\"M0 0L9 9\"/></svg>";

class Report : public Cli {
 protected:
    /// What `model` leaves, by the single commands.
    std::string run_folder(const std::string& name) {
        fs::create_directory(at(name));
        const auto in = [&](const std::string& file) { return at(name + "/" + file); };
        phantom("specimen.mrc", 24, {}, "torus");
        Json stages = Json::array();
        const auto stage = [&](const std::string& key, const std::string& title, const Words& words) {
            const Json result = json(words);
            stages.push_back({{"name", key},
                              {"title", title},
                              {"status", "done"},
                              {"commands", Json::array({words})},
                              {"seconds", 0.5},
                              {"warnings", Json::array()},
                              {"files", Json::array()},
                              {"result", result}});
        };
        stage("map", "Map", {"convert", at("specimen.mrc"), in("density.vdb")});
        stage("surface", "Surface", {"surface", in("density.vdb"), in("surface.ply"), "--iso", "0.5"});
        stage("curvature", "Curvature", {"curvature", in("surface.ply"), in("curved.ply")});
        stage("pockets", "Pockets",
              {"pockets", in("curved.ply"), in("pockets.csv"), "--mesh", in("pockets.ply"), "--min-area", "1",
               "--k2-below", "-0.001", "--k1-below", "inf"});
        stage("tets", "Tetrahedra", {"tetrahedralize", in("density.vdb"), in("tets.vtu"), "--iso", "0.5"});
        stages.push_back({{"name", "denoise"}, {"title", "Noise removal"}, {"status", "off"}});
        good({"render", in("curved.ply"), in("mean.png"), "--color-by", "H", "--width", "160", "--occlusion",
              "0", "-q"});
        make(name + "/density.svg", plot);
        for (const char axis : {'x', 'y', 'z'})
            for (const char* when : {"before", "after"})
                fs::copy_file(in("mean.png"), in(std::string("slices_") + when + "_" + axis + ".png"));
        summary_ = {{"program", "vdbgeo"},
                    {"input", "specimen.mrc"},
                    {"status", "done"},
                    {"preset", "molecule"},
                    {"options", {{"iso", "0.5"}}},
                    {"versions", {{"vdbgeo", "0.1.0"}}},
                    {"seconds", 3.5},
                    {"stages", stages}};
        make(name + "/summary.json", summary_.dump());
        return at(name);
    }

    /// A page that a validator has nothing against, and that fetches nothing.
    HtmlPage sound(const std::string& file) const {
        const HtmlPage page = HtmlReader::read(bytes(file));
        std::string problems;
        for (const std::string& p : page.problems) problems += p + "\n";
        EXPECT_EQ(problems, "");
        for (const std::string& s : page.sources) EXPECT_EQ(s.rfind("data:", 0), 0u) << s.substr(0, 80);
        for (const std::string& l : page.links)
            EXPECT_TRUE(l.rfind("#", 0) == 0 || l == "data:," || l.rfind("https://doi.org/", 0) == 0) << l;
        return page;
    }

    static void expect_sections(const HtmlPage& page, const std::set<std::string>& there) {
        for (const char* id : {"summary", "specimen", "pockets", "noise", "plots", "pictures", "numbers",
                               "how", "cite", "missing"})
            EXPECT_EQ(page.ids.count(id), there.count(id)) << id;
    }

    Json summary_;
};

}  // namespace

TEST_F(Report, TellsAWholeRun) {
    const std::string folder = run_folder("run");
    const Json j = json({"report", folder, "--title", "A <torus>"});
    EXPECT_EQ(j["out"], folder + "/report.html");
    const HtmlPage page = sound("run/report.html");
    EXPECT_EQ(j["bytes"].get<std::size_t>(), bytes("run/report.html").size());
    expect_sections(page, {"summary", "specimen", "pockets", "noise", "plots", "pictures", "numbers", "how",
                           "cite", "missing"});
    for (const char* words : {"A &lt;torus&gt;", "specimen.mrc", "24 × 24 × 24 voxels", "0.5 (the isovalue)",
                              "Switched off in this run.", "vdbgeo surface", "@article{FengXiaTongWei2012",
                              "doi:10.1002/cnm.2532", "Genus"})
        EXPECT_NE(page.words.find(words), std::string::npos) << words;
    const Json data = Json::parse(page.data);
    EXPECT_EQ(data["title"], "A <torus>");
    EXPECT_EQ(data["surface"]["faces"], summary_["stages"][1]["result"]["faces"]);
    EXPECT_EQ(data["surface"]["faces"], data["surface"]["faces_full"]);
    std::vector<std::string> keys;
    for (const Json& p : data["surface"]["properties"]) keys.push_back(p["key"]);
    EXPECT_EQ(keys, (std::vector<std::string>{"H", "K", "k1", "k2", "shape_index", "curvedness", "type",
                                              "pocket"}));
    EXPECT_EQ(data["tets"]["properties"][0]["key"], "min_dihedral_deg");
    EXPECT_EQ(data["tets"]["tets_full"], summary_["stages"][4]["result"]["tets"]);
    EXPECT_EQ(data["pockets"].size(), summary_["stages"][3]["result"]["pockets"].get<std::size_t>());
    EXPECT_GT(data["pockets"].size(), 0u);
}

TEST_F(Report, SameBytesForAnyNumberOfThreads) {
    const std::string folder = run_folder("run");
    good({"report", folder, "-o", at("one.html"), "-j", "1", "-q", "--faces", "500", "--tets", "500"});
    good({"report", folder, "-o", at("two.html"), "-j", "7", "-q", "--faces", "500", "--tets", "500"});
    EXPECT_EQ(bytes("one.html"), bytes("two.html"));
    EXPECT_FALSE(fs::exists(folder + "/report.html"));
    EXPECT_EQ(vdbgeo({"report", folder, "-o", "-", "-q", "--faces", "500", "--tets", "500"}).out,
              bytes("one.html"));
}

TEST_F(Report, MakesMeshesFitThePage) {
    const std::string folder = run_folder("run");
    const Json j = json({"report", folder, "--faces", "600", "--tets", "900"});
    EXPECT_LE(j["faces"].get<int>(), 600);
    EXPECT_GT(j["faces"].get<int>(), 300);
    EXPECT_LE(j["tets"].get<int>(), 900);
    EXPECT_GT(j["tets"].get<int>(), 100);
    const HtmlPage page = sound("run/report.html");
    EXPECT_NE(page.words.find("simplified from"), std::string::npos);
    EXPECT_NE(page.words.find("larger ones that fill the same body"), std::string::npos);
    const Json data = Json::parse(page.data);
    EXPECT_EQ(data["surface"]["faces"], j["faces"]);
    EXPECT_EQ(data["surface"]["faces_full"], summary_["stages"][1]["result"]["faces"]);
    EXPECT_EQ(data["surface"]["properties"].size(), 8u);  // all carried over
}

TEST_F(Report, KeepsThePageWithinItsSize) {
    const std::string folder = run_folder("run");
    const auto whole = json({"report", folder})["bytes"].get<std::size_t>();
    const std::size_t bound = whole - 20000;
    const Json j = json({"report", folder, "--max-size", std::to_string(bound)});
    EXPECT_LE(bytes("run/report.html").size(), bound);
    EXPECT_GT(j["notes"].size(), 0u);
    sound("run/report.html");
    // So little that no words fit.
    expect_error(vdbgeo({"report", folder, "--max-size", "10K"}), 2, "--max-size");
}

TEST_F(Report, OnAnAbortedRunTellsWhatIsThere) {
    const std::string folder = run_folder("run");
    for (const char* gone :
         {"summary.json", "pockets.csv", "pockets.ply", "tets.vtu", "mean.png", "slices_after_x.png"})
        fs::remove(folder + "/" + gone);
    good({"report", folder});
    const HtmlPage page = sound("run/report.html");
    expect_sections(page, {"summary", "specimen", "noise", "plots", "numbers", "cite", "missing"});
    EXPECT_NE(page.words.find("There is no summary of it"), std::string::npos);
    EXPECT_NE(page.words.find("pockets.csv"), std::string::npos);
    EXPECT_NE(page.words.find("Measured for this page on curved.ply"), std::string::npos);
    EXPECT_TRUE(Json::parse(page.data)["tets"].is_null());
}

TEST_F(Report, TellsTheStatesOfStages) {
    const std::string folder = run_folder("run");
    summary_["status"] = "interrupted";
    summary_["stages"][3]["status"] = "failed";
    summary_["stages"][3]["error"] = "it <broke>";
    summary_["stages"][4]["status"] = "reused";
    summary_["stages"][0]["warnings"] = {"odd & even"};
    make("run/summary.json", summary_.dump());
    good({"report", folder});
    const std::string words = sound("run/report.html").words;
    for (const char* told : {"It was interrupted", "Failed: it &lt;broke&gt;", "Taken from an earlier run",
                             "Warning: odd &amp; even"})
        EXPECT_NE(words.find(told), std::string::npos) << told;
}

TEST_F(Report, TellsEachDamagedFileAndGoesOn) {
    const std::string folder = run_folder("run");
    const std::vector<std::pair<std::string, std::string>> damage{
        {"summary.json", "no JSON"},
        {"pockets.csv", "id,area_A2\n1\n"},
        {"mean.png", bytes("run/mean.png").substr(0, 200)},
        {"density.svg", "<html>no drawing</html>"},
        {"pockets.ply", bytes("run/pockets.ply").substr(0, 900)},
        {"tets.vtu", bytes("run/tets.vtu").substr(0, 900)}};
    for (const auto& [file, content] : damage) {
        const std::string sound_bytes = bytes("run/" + file);
        make("run/" + file, content);
        const Ended r = good({"report", folder, "-q"});
        EXPECT_NE(r.err.find("/" + file + ": "), std::string::npos) << file << r.err;
        const HtmlPage page = sound("run/report.html");
        EXPECT_NE(page.words.find(file), std::string::npos) << file;
        EXPECT_NE(page.words.find("Cannot be used: "), std::string::npos) << file;
        make("run/" + file, sound_bytes);
    }
    // All at once.
    for (const auto& [file, content] : damage) make("run/" + file, content);
    good({"report", folder, "-q"});
    // curved.ply takes the place of the damaged pockets.ply.
    EXPECT_EQ(Json::parse(sound("run/report.html").data)["surface"]["properties"].size(), 7u);
}

TEST_F(Report, SurvivesSummariesOfAnyShape) {
    const std::string folder = run_folder("run");
    const std::string deep = std::string(100000, '[') + std::string(100000, ']');
    for (const std::string& text :
         {std::string("[]"), std::string("{}"), std::string("{\"stages\": 3, \"options\": 7, \"input\": []}"),
          std::string("{\"stages\": [1, null, {}, {\"name\": 4, \"result\": [], \"command\": [3, {}], "
                      "\"seconds\": \"x\"}]}"),
          std::string("{\"stages\": [{\"name\": \"map\", \"status\": \"done\", \"result\": {\"size\": \"x\", "
                      "\"voxel_size_A\": [1], "
                      "\"a\": {\"b\": {\"c\": {\"d\": {\"e\": {\"f\": 1}}}}}, \"list\": [{\"x\": 1}], \"n\": "
                      "[null, {}, 1e999]}}]}"),
          deep, "{\"a\": " + deep + "}", std::string("\xFF\xFE")}) {
        make("run/summary.json", text);
        good({"report", folder, "-q"});
        sound("run/report.html");
    }
}

TEST_F(Report, ScriptsInFilesStayText) {
    const std::string folder = run_folder("run");
    make("run/density.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"><script>alert(1)</script></svg>");
    summary_["input"] = "</title><script>alert(2)</script>.mrc";
    summary_["stages"][1]["commands"] = Json::array({{"surface", "<img src=x onerror=alert(3)>", "it's"}});
    summary_["stages"][1]["result"]["<b>key</b>"] = "</script><script>alert(4)</script>";
    make("run/summary.json", summary_.dump());
    good({"report", folder});
    sound("run/report.html");
    const std::string html = bytes("run/report.html");
    for (const char* alive : {"<script>alert", "<img src=x", "<b>key"})
        EXPECT_EQ(html.find(alive), std::string::npos) << alive;
    EXPECT_NE(html.find("&#39;it&#39;\\&#39;&#39;s&#39;"), std::string::npos);  // 'it'\''s', as it is typed
}

TEST_F(Report, ShowsAnySurface) {
    fs::create_directory(at("run"));
    // Thousands of pieces, more than faces can be had for.
    vdbgeo::TriMesh dust;
    for (int i = 0; i < 3000; ++i) {
        vdbgeo::TriMesh one = icosphere(0, 1 + (i == 1234));
        for (auto& p : one.points) p += vdbgeo::Vec3f(4.0f * float(i % 50), 4.0f * float(i / 50), 0);
        const auto first = static_cast<vdbgeo::VertexId>(dust.points.size());
        dust.points.insert(dust.points.end(), one.points.begin(), one.points.end());
        for (const auto& t : one.triangles)
            dust.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
    vdbgeo::write_mesh(dust, at("run/surface.ply"));
    Json j = json({"report", at("run"), "--faces", "5000"});
    EXPECT_LE(j["faces"].get<int>(), 5000);
    EXPECT_GT(j["faces"].get<int>(), 4000);
    EXPECT_NE(sound("run/report.html").words.find("smallest pieces are left out"), std::string::npos);
    // No oriented manifold: a face turned over, another twice.
    vdbgeo::TriMesh odd = icosphere(4, 10);
    std::swap(odd.triangles[5][0], odd.triangles[5][1]);
    odd.triangles.push_back(odd.triangles[100]);
    vdbgeo::write_mesh(odd, at("run/surface.ply"));
    j = json({"report", at("run"), "--faces", "1000"});
    EXPECT_LE(j["faces"].get<int>(), 1000);
    EXPECT_GT(j["faces"].get<int>(), 500);
    // No face at all.
    vdbgeo::write_mesh({}, at("run/surface.ply"));
    j = json({"report", at("run")});
    EXPECT_EQ(j["faces"], 0);
    EXPECT_NE(sound("run/report.html").words.find("it has no triangles"), std::string::npos);
}

TEST_F(Report, MoreThan254Pockets) {
    fs::create_directory(at("run"));
    vdbgeo::TriMesh mesh = icosphere(3, 10);
    vdbgeo::MeshProperty ids{"pocket", 1, std::vector<float>(mesh.points.size())};
    for (std::size_t v = 0; v < ids.values.size(); ++v) ids.values[v] = static_cast<float>(v % 400);
    mesh.vertex_properties.push_back(ids);
    vdbgeo::write_mesh(mesh, at("run/pockets.ply"));
    std::string csv = "id,area_A2,depth_A\n";
    for (int i = 1; i <= 399; ++i) csv += std::to_string(i) + ",5.5,1\n";
    make("run/pockets.csv", csv);
    good({"report", at("run")});
    const HtmlPage page = sound("run/report.html");
    const Json data = Json::parse(page.data);
    const Json& pocket = data["surface"]["properties"][0];
    EXPECT_EQ(pocket["kind"], "category");
    EXPECT_EQ(pocket["classes"].size(), 254u);
    EXPECT_NE(pocket["help"].get<std::string>().find("first 254"), std::string::npos);
    EXPECT_TRUE(page.ids.count("pocket-table-more"));
    EXPECT_EQ(data["pockets"].size(), 0u);  // without a place there is nowhere to fly to
}

TEST_F(Report, RefusesWhatIsNoRun) {
    fs::create_directory(at("empty"));
    expect_error(vdbgeo({"report", at("empty")}), 3, at("empty"), "nothing to report on");
    EXPECT_FALSE(fs::exists(at("empty/report.html")));
    make("empty/other.txt", "x");
    expect_error(vdbgeo({"report", at("empty")}), 3, at("empty"), "nothing to report on");
    expect_error(vdbgeo({"report", at("none")}), 4, at("none"), "no such folder");
    expect_error(vdbgeo({"report", make("file", "x")}), 3, at("file"), "is a file");
    fs::create_directory(at("run"));
    make("run/surface.ply", "ply\n");
    expect_error(vdbgeo({"report", at("run"), "-o", at("no/such/page.html")}), 4, at("no/such/page.html"));
    for (const Words& flags : {Words{"--faces", "3"}, Words{"--tets", "0"}, Words{"--max-size", "big"},
                               Words{"--max-size", "-1M"}}) {
        Words words{"report", at("run")};
        words.insert(words.end(), flags.begin(), flags.end());
        expect_error(vdbgeo(words), 2, flags[0]);
    }
}
