// The whole protocol on real maps, and on a shape whose numbers are known.
#include <Eigen/LU>
#include <png.h>

#include <map>

#include "converters/map_file.h"
#include "converters/mesh_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/data.h"

using namespace vdbgeo::test;
using vdbgeo::Vec3d;

namespace {

struct Picture {
    std::size_t width = 0, height = 0, colours = 0;
    double drawn = 0;  ///< share of the pixels that differ from the corner's
};

Picture read_picture(const std::string& path) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    EXPECT_TRUE(png_image_begin_read_from_file(&image, path.c_str())) << path << ": " << image.message;
    image.format = PNG_FORMAT_RGBA;
    std::vector<std::uint32_t> pixels(PNG_IMAGE_SIZE(image) / 4);
    EXPECT_TRUE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr)) << path;
    Picture picture{image.width, image.height, std::set<std::uint32_t>(pixels.begin(), pixels.end()).size(),
                    0};
    for (const std::uint32_t pixel : pixels) picture.drawn += pixel != pixels[0];
    picture.drawn /= static_cast<double>(pixels.size());
    return picture;
}

class Model : public Cli {
 protected:
    /// Runs `model`, checks what every model has, and returns the numbers of its surface.
    Json model(const std::string& map, Words more, bool closed = true) {
        Words words{"model", map, "-o", at("m"), "--width", "320", "--occlusion", "0", "--json"};
        words.insert(words.end(), more.begin(), more.end());
        const Ended r = good(words);
        err_ = r.err;
        summary_ = Json::parse(r.out, nullptr, false);
        EXPECT_EQ(summary_["status"], "done");
        for (const Json& entry : summary_["stages"]) {
            EXPECT_NE(entry["status"], "failed") << entry;
            for (const Json& file : entry.value("files", Json::array()))
                EXPECT_EQ(bytes("m/" + file["name"].get<std::string>()).size(), file["bytes"]) << file;
        }
        for (const char* name :
             {"density.vdb", "smooth.vdb", "surface.ply", "mesh.ply", "curved.ply", "pockets.csv", "tets.vtu",
              "angles.svg", "map.png", "mean.png", "cut.png", "report.html", "summary.json"})
            EXPECT_TRUE(listing().count(std::string("m/") + name)) << name;
        const Json j = json({"measure", at("m/surface.ply")});
        EXPECT_EQ(j["manifold"], true);
        EXPECT_EQ(j["oriented"], true);
        EXPECT_EQ(j["closed"], closed);
        EXPECT_GT(j["faces"], 100);
        EXPECT_GT(j["area_A2"], 0.0);
        if (closed) {
            EXPECT_EQ(j["boundary_edges"], 0);
            EXPECT_TRUE(j["genus"].is_number_integer()) << j["genus"];
            EXPECT_GT(j["volume_A3"], 0.0);
            EXPECT_EQ(err_.find("open where"), std::string::npos) << err_;
        }
        const Json measured = stage("measure")["result"]["files"];
        EXPECT_EQ(measured.size(), 2u);
        for (const char* key : {"vertices", "faces", "genus", "boundary_edges", "area_A2", "volume_A3"})
            EXPECT_EQ(measured[0][key], j[key]) << key;
        EXPECT_LT(measured[1]["below_30_percent"], 0.5);
        EXPECT_LT(measured[1]["below_30_percent"], 0.1 * measured[0]["below_30_percent"].get<double>());
        for (const char* name : {"m/map.png", "m/mean.png", "m/cut.png"}) {
            const Picture picture = read_picture(at(name));
            EXPECT_GT(picture.colours, 30u) << name;
            EXPECT_GT(picture.drawn, 0.05) << name;
        }
        return j;
    }
    Json stage(const std::string& name) const {
        for (const Json& entry : summary_["stages"])
            if (entry["name"] == name) return entry;
        ADD_FAILURE() << "no stage " << name;
        return {};
    }

    Json summary_;
    std::string err_;
};

/// The faces of the box (bits 0…5) that a point given in index coordinates lies on.
unsigned border_of(const Vec3d& index, const vdbgeo::Vec3i& size) {
    unsigned faces = 0;
    for (int a = 0; a < 3; ++a) {
        if (std::abs(index[a]) < 1e-2) faces |= 1u << a;
        if (std::abs(index[a] - (size[a] - 1)) < 1e-2) faces |= 8u << a;
    }
    return faces;
}

/// Expects every edge with one face to lie in a face of the map's box; returns how many there are.
std::int64_t expect_open_at_border_only(const std::string& mesh_file, const std::string& map_file) {
    const vdbgeo::TriMesh mesh = vdbgeo::read_mesh(mesh_file);
    const vdbgeo::Frame frame = vdbgeo::MrcReader(map_file).frame();
    const vdbgeo::Mat3d to_index = frame.axes.inverse();
    std::map<std::pair<vdbgeo::VertexId, vdbgeo::VertexId>, int> faces_of;
    for (const vdbgeo::Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) ++faces_of[std::minmax(t[k], t[(k + 1) % 3])];
    std::int64_t open = 0, inside = 0;
    for (const auto& [edge, faces] : faces_of) {
        if (faces != 1) continue;
        ++open;
        const auto index = [&](vdbgeo::VertexId v) {
            return Vec3d(to_index * (mesh.points[v].cast<double>() - frame.origin));
        };
        inside += (border_of(index(edge.first), frame.size) & border_of(index(edge.second), frame.size)) == 0;
    }
    EXPECT_EQ(inside, 0) << "open edges inside the box, of " << open;
    return open;
}

}  // namespace

TEST_F(Model, OfGroEL) {
    VDBGEO_NEEDS_DATA("multifit_groel/groel-11.5A.mrc");
    model((data_folder() / "multifit_groel/groel-11.5A.mrc").string(), {});
    EXPECT_GT(stage("surface")["result"]["iso"], 0.0);
}

TEST_F(Model, OfAMapWithFourfoldSymmetry) {
    VDBGEO_NEEDS_DATA("mainmastseg/MAP_m4A.mrc.gz");
    model((data_folder() / "mainmastseg/MAP_m4A.mrc.gz").string(), {"--iso", "0.7"});
    EXPECT_EQ(stage("surface")["result"]["iso"], 0.7);
    EXPECT_GT(stage("pockets")["result"]["pockets"], 50);
    EXPECT_GE(stage("tets")["result"]["min_dihedral_deg"], 15.0);
}

TEST_F(Model, OfBetaGalactosidase) {
    VDBGEO_NEEDS_DATA("ngl/betaGal.mrc");
    model((data_folder() / "ngl/betaGal.mrc").string(), {});
}

TEST_F(Model, OfATomogramIsOpenAtTheBorderAndSaysSo) {
    VDBGEO_NEEDS_DATA("pymol/emd_1155.ccp4");
    const std::string map = (data_folder() / "pymol/emd_1155.ccp4").string();
    const Json j = model(map, {"--invert", "--iso", "2.2sigma"}, false);
    EXPECT_GT(j["boundary_edges"], 0);
    EXPECT_TRUE(j["volume_A3"].is_null());
    EXPECT_NE(err_.find("the surface is open"), std::string::npos) << err_;
    EXPECT_NE(err_.find("border of the map"), std::string::npos) << err_;
    EXPECT_EQ(expect_open_at_border_only(at("m/surface.ply"), map), j["boundary_edges"].get<std::int64_t>());
}

TEST_F(Model, OfKnownShapesHasTheirNumbers) {
    const double r = 100, ring = 100, tube = 40, pi = M_PI;
    Json j = model(phantom("sphere.mrc", 96), {"--iso", "0"});
    EXPECT_EQ(j["genus"], 0);
    EXPECT_EQ(j["components"], 1);
    EXPECT_NEAR(j["area_A2"], 4 * pi * r * r, 0.01 * 4 * pi * r * r);
    EXPECT_NEAR(j["volume_A3"], 4 * pi * r * r * r / 3, 0.01 * 4 * pi * r * r * r / 3);
    j = model(phantom("torus.mrc", 96, {}, "torus"), {"--iso", "0"});
    EXPECT_EQ(j["genus"], 1);
    EXPECT_NEAR(j["area_A2"], 4 * pi * pi * ring * tube, 0.01 * 4 * pi * pi * ring * tube);
    EXPECT_NEAR(j["volume_A3"], 2 * pi * pi * ring * tube * tube, 0.01 * 2 * pi * pi * ring * tube * tube);
}

TEST_F(Model, OfAnInvertedMapIsTheSame) {
    const std::string map = phantom("a.mrc", 40, {}, "torus");
    const Json straight = model(map, {"--iso", "0"});
    // The same field with its sign changed: what `--invert` undoes.
    std::string turned = bytes("a.mrc");
    for (std::size_t i = 1024 + 3; i < turned.size(); i += 4)
        turned[i] = static_cast<char>(turned[i] ^ '\x80');
    const Json j = model(make("b.mrc", turned), {"--invert", "--iso", "0"});
    for (const char* key : {"vertices", "faces", "genus", "area_A2", "volume_A3"})
        EXPECT_EQ(j[key], straight[key]);
}

TEST_F(Model, OfAGridIsThatOfItsMap) {
    const std::string map = phantom("a.mrc", 40);
    const Json from_map = model(map, {"--iso", "0"});
    good({"convert", map, at("a.vdb")});
    const Json from_grid = model(at("a.vdb"), {"--iso", "0"});
    for (const char* key : {"vertices", "faces", "genus"}) EXPECT_EQ(from_grid[key], from_map[key]) << key;
    for (const char* key : {"area_A2", "volume_A3"})
        EXPECT_NEAR(from_grid[key], from_map[key], 1e-7 * from_map[key].get<double>()) << key;
}
