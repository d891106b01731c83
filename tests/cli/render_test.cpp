// vdbgeo render: several things in a picture, sections, turntables, cut-open tetrahedra; denoise --slices.
#include <cmath>

#include "converters/tet_file.h"
#include "tests/cli/filter_test.h"
#include "tests/support/tet_meshes.h"

using namespace vdbgeo::test;

namespace {

struct Pixels {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;
};

class RenderCli : public FilterCli {
 protected:
    void SetUp() override {
        map_ = phantom("ball.mrc", 24);
        good({"surface", map_, at("ball.ply"), "--quiet"});
        mesh_ = at("ball.ply");
    }
    Pixels picture(const std::string& name) const {
        png_image header{};
        header.version = PNG_IMAGE_VERSION;
        if (!png_image_begin_read_from_file(&header, at(name).c_str())) return {};
        header.format = PNG_FORMAT_RGB;
        Pixels p{static_cast<int>(header.width), static_cast<int>(header.height), {}};
        p.rgb.resize(PNG_IMAGE_SIZE(header));
        png_image_finish_read(&header, nullptr, p.rgb.data(), 0, nullptr);
        return p;
    }
    /// The words of a render that takes little time.
    Words quick(Words words) const {
        words.insert(words.begin(), "render");
        for (const char* word : {"--width", "200", "--occlusion", "0", "--samples", "1", "--quiet"})
            words.push_back(word);
        return words;
    }

    std::string map_, mesh_;
};

}  // namespace

TEST_F(RenderCli, DrawsSeveralBesideEachOther) {
    vdbgeo::write_tets(ball_tets(10, 3), at("tets.vtu"));
    const Json j = json({"render", map_, mesh_, at("tets.vtu"), at("three.png"), "--view", "front", "--width",
                         "300", "--occlusion", "0", "--quiet"});
    EXPECT_EQ(j["width"], 300);
    EXPECT_LT(j["height"], 250);
    EXPECT_EQ(j["out"], at("three.png"));
    good(quick({map_, mesh_, at("two.png"), "--view", "front", "--labels", "a,b"}));
    good(quick({map_, mesh_, at("other.png"), "--view", "front", "--labels", "a,c"}));
    EXPECT_NE(bytes("two.png"), bytes("other.png"));
    good(quick({map_, mesh_, at("column.png"), "--view", "front", "--columns", "1"}));
    EXPECT_GT(picture("column.png").height, 1.4 * picture("two.png").height);
    good(quick({map_, mesh_, at("rows.png")}));  // three views of each
    EXPECT_GT(picture("rows.png").height, 100);
}

TEST_F(RenderCli, DrawsSections) {
    const Json j = json({"render", map_, at("s.png"), "--slices", "--width", "300", "--quiet"});
    EXPECT_EQ(j["width"], 300);
    EXPECT_EQ(picture("s.png").height, j["height"]);
    std::set<std::string> pictures{bytes("s.png")};
    for (const Words& more :
         {Words{"--iso", "0.5"}, Words{"--slice", "z=4"}, Words{"--slice", "z=0A", "--slice", "x=3"},
          Words{"--color-map", "diverging"}, Words{"--min", "0.2", "--max", "3"},
          Words{"--background", "dark"}, Words{"--title", "sections"}, Words{"--color-label", "x"},
          Words{"--labels", "ball"}}) {
        Words words{"render", map_, at("s.png"), "--slices", "--width", "300", "--quiet"};
        words.insert(words.end(), more.begin(), more.end());
        good(words);
        pictures.insert(bytes("s.png"));
    }
    EXPECT_EQ(pictures.size(), 10u);  // no two are the same
    good({"render", map_, map_, at("two.png"), "--slices", "--width", "300", "--quiet"});
    EXPECT_GT(picture("two.png").height, 1.4 * j["height"].get<double>());
    // A voxel and its place in Å are the same section: the phantom is centred at the origin.
    const Json info = json({"info", map_});
    const double origin = info["origin_A"][2], step = info["voxel_size_A"][2];
    good({"render", map_, at("a.png"), "--slice", "z=7", "--width", "300", "--quiet"});
    good({"render", map_, at("b.png"), "--slice", "z=" + std::to_string(origin + 7 * step) + "A", "--width",
          "300", "--quiet"});
    EXPECT_EQ(bytes("a.png"), bytes("b.png"));
}

TEST_F(RenderCli, TurnsTheSpecimen) {
    Words words = quick({mesh_, at("film.png"), "--turntable", "3"});
    const Json j = json(words);
    EXPECT_EQ(j["frames"], Json({at("film_0001.png"), at("film_0002.png"), at("film_0003.png")}));
    EXPECT_FALSE(listing().count("film.png"));
    for (const char* name : {"film_0001.png", "film_0002.png", "film_0003.png"}) {
        EXPECT_EQ(picture(name).width, 200);
        EXPECT_EQ(picture(name).height, j["height"]);
    }
    EXPECT_NE(bytes("film_0001.png"), bytes("film_0002.png"));
}

TEST_F(RenderCli, CutsTetrahedraOpen) {
    vdbgeo::write_tets(ball_tets(10, 2.5), at("tets.vtu"));
    std::set<std::string> pictures;
    for (const Words& more : {Words{"--clip", "y"}, Words{"--clip", "y=0.3"}, Words{"--clip", "x"},
                              Words{"--clip", "z=0.7", "--edges"}, Words{"--clip", "y", "--view", "iso"},
                              Words{"--clip", "y", "--color-by", "radius_edge"}}) {
        Words words = quick({at("tets.vtu"), at("cut.png")});
        words.insert(words.end(), more.begin(), more.end());
        good(words);
        pictures.insert(bytes("cut.png"));
    }
    EXPECT_EQ(pictures.size(), 6u);
    // The same as what cutaway draws.
    good({"cutaway", at("tets.vtu"), at("a.png"), "--clip", "--no-edges", "--width", "200", "--occlusion",
          "0", "--samples", "1", "--quiet"});
    good(quick({at("tets.vtu"), at("b.png"), "--clip", "y"}));
    EXPECT_EQ(bytes("a.png"), bytes("b.png"));
}

TEST_F(RenderCli, BackgroundsAndLines) {
    const auto corner = [&](const std::string& background) {
        good(quick({mesh_, at("b.png"), "--background", background}));
        const Pixels p = picture("b.png");
        return std::vector<int>(p.rgb.begin(), p.rgb.begin() + 3);
    };
    EXPECT_EQ(corner("white"), std::vector<int>({255, 255, 255}));
    EXPECT_EQ(corner("black"), std::vector<int>({0, 0, 0}));
    EXPECT_EQ(corner("#12aBef"), std::vector<int>({0x12, 0xab, 0xef}));
    EXPECT_LT(corner("dark")[0], 40);
    std::set<std::string> pictures;
    for (const char* flag : {"--edges", "--no-scale-bar", "--no-silhouette", "--silhouettes-only", "--zoom=3",
                             "--focus=3,0,0"}) {
        good(quick({mesh_, at("l.png"), flag}));
        pictures.insert(bytes("l.png"));
    }
    EXPECT_EQ(pictures.size(), 6u);
}

TEST_F(RenderCli, SameBytesForAnyThreads) {
    expect_same_bytes({"render", mesh_, at("t.png"), "--turntable", "2", "--width", "200"},
                      {"t_0001.png", "t_0002.png"});
    expect_same_bytes({"render", map_, mesh_, at("two.png"), "--width", "200"}, {"two.png"});
    expect_same_bytes({"render", map_, at("s.png"), "--slices", "--iso", "0.5", "--width", "200"}, {"s.png"});
}

TEST_F(RenderCli, RefusesWhatMakesNoSense) {
    const auto fails = [&](Words words, int code, const std::string& subject, const std::string& text = "") {
        words.insert(words.begin(), "render");
        words.push_back("--quiet");
        expect_error(vdbgeo(words), code, subject, text);
        EXPECT_FALSE(listing().count("bad.png"));
    };
    const std::string out = at("bad.png");
    fails({map_}, 2, "render:", "OUT.png");
    fails({out}, 2, "render:", "OUT.png");
    fails({map_, mesh_}, 2, mesh_ + ":", ".png");
    fails({map_, mesh_, out, "--labels", "one"}, 2, "--labels:", "1 names for 2 files");
    fails({mesh_, out, "--focus", "1,2"}, 2, "", "x,y,z");
    fails({mesh_, out, "--background", "green"}, 2, "", "#rrggbb");
    fails({mesh_, out, "--background", "#12345g"}, 2, "", "#rrggbb");
    fails({mesh_, out, "--zoom", "0"}, 2, "zoom");
    fails({mesh_, out, "--turntable", "0"}, 2, "");
    fails({mesh_, "-", "--turntable", "4"}, 2, "--turntable");
    fails({mesh_, out, "--silhouettes-only", "--no-silhouette"}, 2, "a drawing of lines");
    fails({mesh_, out, "--clip", "w"}, 2, "--clip:", "'w'");
    fails({mesh_, out, "--clip", "x=1.5"}, 2, "--clip:", "x=1.5");
    fails({mesh_, out, "--clip", "x="}, 2, "--clip:");
    fails({mesh_, out, "--clip", "x"}, 2, mesh_, "tetrahedral");
    fails({mesh_, out, "--slices"}, 2, mesh_, "maps");
    fails({map_, out, "--slices", "--zoom", "2"}, 2, "--zoom", "--slices");
    fails({map_, out, "--slices", "--color-by", "H"}, 2, "--color-by", "--slices");
    fails({map_, out, "--slices", "--turntable", "3"}, 2, "--turntable", "--slices");
    for (const char* slice : {"w=3", "z=", "z=1.5", "z=3B", "z3", "=3", "z=nan"})
        fails({map_, out, "--slice", slice}, 2, "--slice:", "z=120A");
    fails({map_, out, "--slice", "z=24"}, 3, map_, "0 to 23");
    fails({map_, out, "--slice", "z=-1"}, 3, map_, "0 to 23");
    fails({map_, out, "--slice", "x=5000A"}, 3, map_, "0 to 23");
    fails({at("none.mrc"), out, "--slices"}, 4, at("none.mrc"));
    fails({map_, at("none/bad.png")}, 4, at("none/bad.png"), "no folder");
    fails({map_, mesh_, out, "--color-by", "H"}, 3, "ball.mrc: ", "no property 'H'");
}

TEST_F(RenderCli, DenoiseWritesPairsOfSections) {
    const Json j = json(
        {"denoise", noisy("noisy.mrc", 32), at("b.mrc"), "--time", "2", "--slices", at("pair"), "--quiet"});
    std::vector<std::string> names;
    for (const char* word : {"before", "after"})
        for (const char* axis : {"x", "y", "z"})
            names.push_back(std::string("pair_") + word + "_" + axis + ".png");
    ASSERT_EQ(j["slices"].size(), 6u);
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_EQ(j["slices"][i], at(names[i]));
        const Pixels p = picture(names[i]);
        EXPECT_EQ(p.width, 320);  // 32 voxels of 10 pixels
        EXPECT_EQ(p.height, 320);
    }
    // Less noise: neighbouring voxels differ less.
    const auto roughness = [&](const std::string& name) {
        const Pixels p = picture(name);
        double sum = 0;
        for (int y = 5; y < p.height; y += 10)
            for (int x = 5; x + 10 < p.width; x += 10)
                sum += std::abs(p.rgb[static_cast<std::size_t>(3 * (y * p.width + x))] -
                                p.rgb[static_cast<std::size_t>(3 * (y * p.width + x + 10))]);
        return sum;
    };
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(roughness(names[i + 3]), 0.6 * roughness(names[i]));
    expect_error(vdbgeo({"denoise", map_, at("c.mrc"), "--time", "1", "--quiet", "--slices", at("no/pair")}),
                 4, at("no/pair"), "no folder");
    EXPECT_FALSE(listing().count("c.mrc"));
    expect_same_bytes({"denoise", map_, at("d.mrc"), "--time", "1", "--slices", at("d")},
                      {"d_before_x.png", "d_after_z.png"});
}
