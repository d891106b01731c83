// glTF binaries, taken apart by a parser of the test's own.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <cstring>

#include "converters/mesh_file.h"
#include "tests/support/meshes.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;
using Json = nlohmann::json;

namespace {

std::uint32_t word(const std::string& bytes, std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t k = 4; k-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes.at(at + k));
    return value;
}

std::string little(std::uint32_t value) {
    std::string out;
    for (int k = 0; k < 4; ++k) out += static_cast<char>(value >> (8 * k));
    return out;
}

struct Parsed {
    Json json;
    std::string bin;

    std::vector<float> floats(const Json& accessor) const {
        const Json& a = json["accessors"][accessor.get<std::size_t>()];
        const std::map<std::string, std::size_t> sizes{{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}};
        std::vector<float> out(a["count"].get<std::size_t>() * sizes.at(a["type"]));
        const Json& view = json["bufferViews"][a["bufferView"].get<std::size_t>()];
        EXPECT_EQ(a["componentType"], 5126);
        EXPECT_EQ(view["byteLength"], out.size() * 4);
        std::memcpy(out.data(), bin.data() + view["byteOffset"].get<std::size_t>(), out.size() * 4);
        return out;
    }
};

/// Takes a file apart, checking what the format asks of every file.
Parsed parse(const std::string& file) {
    Parsed p;
    EXPECT_EQ(file.substr(0, 4), "glTF");
    EXPECT_EQ(word(file, 4), 2u);
    EXPECT_EQ(word(file, 8), file.size());
    EXPECT_EQ(file.size() % 4, 0u);
    const std::size_t length = word(file, 12);
    EXPECT_EQ(length % 4, 0u);
    EXPECT_EQ(file.substr(16, 4), "JSON");
    p.json = Json::parse(file.substr(20, length));
    if (20 + length < file.size()) {
        EXPECT_EQ(file.substr(24 + length, 4), std::string("BIN\0", 4));
        p.bin = file.substr(28 + length);
        EXPECT_EQ(word(file, 20 + length), p.bin.size());
        EXPECT_EQ(p.json["buffers"][0]["byteLength"], p.bin.size());
    }
    EXPECT_EQ(p.json["asset"]["version"], "2.0");
    EXPECT_EQ(p.json["asset"]["extras"]["unit"], "angstrom");
    if (!p.json.contains("accessors")) return p;
    for (const Json& view : p.json["bufferViews"]) {
        EXPECT_EQ(view["byteOffset"].get<std::size_t>() % 4, 0u);
        EXPECT_LE(view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>(),
                  p.bin.size());
    }
    return p;
}

Parsed written(const TriMesh& mesh) {
    const TempFolder folder;
    write_mesh(mesh, folder / "m.glb");
    return parse(read_bytes(folder / "m.glb"));
}

/// A file of this JSON and these bytes.
std::string glb(Json json, const std::string& bin) {
    json["asset"]["version"] = "2.0";
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    return "glTF" + little(2) + little(static_cast<std::uint32_t>(28 + text.size() + bin.size())) +
           little(static_cast<std::uint32_t>(text.size())) + "JSON" + text +
           little(static_cast<std::uint32_t>(bin.size())) + std::string("BIN\0", 4) + bin;
}

template <class T>
std::string bytes_of(const std::vector<T>& values) {
    return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// Four points, and the indices 0 1 2 0 2 3 as 16 bits.
const std::string square_bytes = bytes_of(std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) +
                                 bytes_of(std::vector<std::uint16_t>{0, 1, 2, 0, 2, 3});

Json square_json() {
    return Json::parse(R"({"buffers": [{"byteLength": 60}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0})");
}

TriMesh read(const std::string& file) {
    const TempFolder folder;
    write_bytes(folder / "m.glb", file);
    return read_mesh(folder / "m.glb");
}

std::string refusal(const std::string& file) {
    const TempFolder folder;
    write_bytes(folder / "m.glb", file);
    try {
        read_mesh(folder / "m.glb");
    } catch (const InvalidInput& error) {
        const std::string text = error.what(), prefix = (folder / "m.glb").string() + ": ";
        EXPECT_EQ(text.substr(0, prefix.size()), prefix);
        return text.substr(std::min(prefix.size(), text.size()));
    }
    return "(not refused)";
}

std::string refusal_of(const std::function<void(Json&)>& change) {
    Json json = square_json();
    change(json);
    return refusal(glb(json, square_bytes));
}

}  // namespace

TEST(MeshGlb, WhatIsWrittenIsValid) {
    TriMesh mesh = test::icosphere(2, 30);
    for (Vec3f& p : mesh.points) p += Vec3f(0.1f, 100, -7);
    mesh.vertex_properties.push_back({"H", 1, std::vector<float>(mesh.points.size(), 0.25f)});
    mesh.vertex_properties.push_back({"color", 3, std::vector<float>(3 * mesh.points.size(), 0.5f)});
    mesh.vertex_properties[1].values[0] = 7;
    mesh.vertex_properties[1].values[1] = NAN;
    const Parsed p = written(mesh);
    const Json& primitive = p.json["meshes"][0]["primitives"][0];
    EXPECT_EQ(primitive["mode"], 4);
    const auto points = p.floats(primitive["attributes"]["POSITION"]);
    ASSERT_EQ(points.size(), 3 * mesh.points.size());
    EXPECT_EQ(std::memcmp(points.data(), mesh.points.data(), points.size() * 4), 0);
    const Json& position = p.json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
    for (std::size_t a = 0; a < 3; ++a) {
        float low = INFINITY, high = -INFINITY;
        for (const Vec3f& q : mesh.points) {
            low = std::min(low, q[static_cast<int>(a)]);
            high = std::max(high, q[static_cast<int>(a)]);
        }
        EXPECT_EQ(position["min"][a].get<float>(), low);
        EXPECT_EQ(position["max"][a].get<float>(), high);
    }
    const auto normals = p.floats(primitive["attributes"]["NORMAL"]);
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        const Vec3f n(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]);
        EXPECT_NEAR(n.norm(), 1, 1e-6);
        EXPECT_GT(n.dot((mesh.points[i] - Vec3f(0.1f, 100, -7)).normalized()), 0.99f);
    }
    const auto colors = p.floats(primitive["attributes"]["COLOR_0"]);
    EXPECT_EQ(colors[0], 1);
    EXPECT_EQ(colors[1], 0);
    EXPECT_EQ(colors[2], 0.5f);
    EXPECT_EQ(p.floats(primitive["attributes"]["_H"]), mesh.vertex_properties[0].values);
    const Json& indices = p.json["accessors"][primitive["indices"].get<std::size_t>()];
    EXPECT_EQ(indices["componentType"], 5125);
    EXPECT_EQ(indices["count"], 3 * mesh.triangles.size());
    const Json& view = p.json["bufferViews"][indices["bufferView"].get<std::size_t>()];
    EXPECT_EQ(std::memcmp(p.bin.data() + view["byteOffset"].get<std::size_t>(), mesh.triangles.data(),
                          12 * mesh.triangles.size()),
              0);
    EXPECT_EQ(p.json["materials"][0]["doubleSided"], true);
}

TEST(MeshGlb, NormalsOfTheMeshStayAndOthersAreComputed) {
    TriMesh mesh = test::icosphere(1, 1);
    MeshProperty normal{"normal", 3, {}};
    for (const Vec3f& p : mesh.points) normal.values.insert(normal.values.end(), p.begin(), p.end());
    mesh.vertex_properties = {normal};
    EXPECT_EQ(written(mesh).floats(1), normal.values);
    const TempFolder folder;
    const auto back = [&] {
        write_mesh(mesh, folder / "m.glb");
        return read_mesh(folder / "m.glb").vertex_properties;
    };
    ASSERT_EQ(back().size(), 1u);
    EXPECT_EQ(back()[0].values, normal.values);
    mesh.vertex_properties[0].values[5] =
        70;  // no unit vector: glTF has no place for it but an attribute of our own
    const Parsed p = written(mesh);
    EXPECT_TRUE(p.json["meshes"][0]["primitives"][0]["attributes"].contains("_normal"));
    ASSERT_EQ(back().size(), 1u);
    EXPECT_EQ(back()[0].values, mesh.vertex_properties[0].values);
    mesh.vertex_properties.clear();
    EXPECT_TRUE(back().empty());
    // A vertex without a face has a unit normal too.
    mesh.points.emplace_back(9, 9, 9);
    const auto normals = written(mesh).floats(1);
    EXPECT_EQ(normals.back(), 1);
}

TEST(MeshGlb, EmptyMeshesAreValid) {
    EXPECT_FALSE(written(TriMesh()).json.contains("meshes"));
    TriMesh points;
    points.points = {Vec3f(1, 2, 3)};
    const Parsed p = written(points);
    EXPECT_EQ(p.json["meshes"][0]["primitives"][0]["mode"], 0);
    EXPECT_FALSE(p.json["meshes"][0]["primitives"][0].contains("indices"));
}

TEST(MeshGlb, FilesOfOtherProgramsAreRead) {
    const TriMesh plain = read(glb(square_json(), square_bytes));
    EXPECT_EQ(plain.triangles, (Array<Triangle>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(plain.points[2], Vec3f(1, 1, 0));
    // Each mode, with and without indices
    Json json = square_json();
    Json& primitive = json["meshes"][0]["primitives"][0];
    primitive.erase("indices");
    primitive["mode"] = 5;
    EXPECT_EQ(read(glb(json, square_bytes)).triangles, (Array<Triangle>{{0, 1, 2}, {1, 3, 2}}));
    primitive["mode"] = 6;
    EXPECT_EQ(read(glb(json, square_bytes)).triangles, (Array<Triangle>{{0, 1, 2}, {0, 2, 3}}));
    primitive["mode"] = 1;
    EXPECT_TRUE(read(glb(json, square_bytes)).points.empty());
    // Without nodes, and without scenes
    json = square_json();
    json.erase("scenes");
    json.erase("scene");
    EXPECT_EQ(read(glb(json, square_bytes)).triangles.size(), 2u);
    json.erase("nodes");
    EXPECT_EQ(read(glb(json, square_bytes)).triangles.size(), 2u);
    EXPECT_TRUE(read(glb(Json::object(), "")).empty());
}

TEST(MeshGlb, NodesAreMovedAndTurned) {
    Json json = square_json();
    json["nodes"] = Json::parse(R"([{"children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476]},
        {"mesh": 0, "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]}])");
    const TriMesh mesh = read(glb(json, square_bytes));
    ASSERT_EQ(mesh.points.size(), 8u);
    EXPECT_LT((mesh.points[1] - Vec3f(10, 2, 0)).norm(), 1e-5);    // x turned to y, doubled, moved
    EXPECT_LT((mesh.points[5] - Vec3f(18, 12, 14)).norm(), 1e-5);  // mirrored: 10 + 2·(5 − 1)
    EXPECT_EQ(mesh.triangles[0], (Triangle{0, 1, 2}));
    EXPECT_EQ(mesh.triangles[2], (Triangle{4, 6, 5}));  // mirrored: turned over
}

TEST(MeshGlb, PrimitivesOfOneMeshShareTheirVerticesAndCommonPropertiesStay) {
    Json json = square_json();
    json["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 6}});
    TriMesh mesh = read(glb(json, square_bytes));
    EXPECT_EQ(mesh.points.size(), 4u);
    EXPECT_EQ(mesh.triangles.size(), 4u);
    // normalised bytes as colours, four components with a stride; in one primitive only, then in both
    const std::string bin =
        square_bytes + bytes_of(std::vector<std::uint8_t>{255, 0, 51, 9, 0, 0, 0, 9, 1, 1, 1, 1, 2, 2, 2, 2});
    json["buffers"][0]["byteLength"] = bin.size();
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 60}, {"byteLength", 16}, {"byteStride", 4}});
    json["accessors"].push_back(
        {{"bufferView", 2}, {"componentType", 5121}, {"normalized", true}, {"count", 4}, {"type", "VEC4"}});
    json["meshes"][0]["primitives"][1]["attributes"]["COLOR_0"] = 2;
    mesh = read(glb(json, bin));
    EXPECT_EQ(mesh.points.size(), 8u);
    EXPECT_TRUE(mesh.vertex_properties.empty());
    json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 2;
    mesh = read(glb(json, bin));
    EXPECT_EQ(mesh.points.size(), 4u);
    ASSERT_NE(mesh.find_vertex_property("color"), nullptr);
    EXPECT_EQ(mesh.find_vertex_property("color")->values[0], 1);
    EXPECT_EQ(mesh.find_vertex_property("color")->values[2], 0.2f);
}

TEST(MeshGlb, DamageIsRefusedByName) {
    const std::string good = glb(square_json(), square_bytes);
    const auto with = [&](std::size_t at, const std::string& bytes) {
        std::string bad = good;
        return bad.replace(at, bytes.size(), bytes);
    };
    EXPECT_EQ(refusal("glTF"), "no glb file: it does not begin with glTF");
    EXPECT_EQ(refusal(with(4, little(1))), "byte 4: expected version 2 of glTF, found 1");
    EXPECT_EQ(refusal(good.substr(0, good.size() - 1)), "byte 8: the file is told to have " +
                                                            std::to_string(good.size()) + " bytes, found " +
                                                            std::to_string(good.size() - 1));
    EXPECT_EQ(refusal(with(16, "XXXX")), "byte 16: the first chunk is not the JSON");
    EXPECT_EQ(refusal(with(12, little(0xFFFFFFFF))).substr(0, 37), "byte 12: a chunk of 4294967295 bytes,");
    EXPECT_EQ(refusal(with(20, "x")), "byte 21: the JSON is damaged");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["count"] = 1000000000000; }),
              "accessor 0: 1000000000000 values of 12 bytes, found 48 bytes");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["count"] = -1; }), "count: expected a whole number");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["type"] = "MAT4"; }),
              "accessor 0: expected SCALAR, VEC2, VEC3 or VEC4");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["type"] = "VEC2"; }),
              "POSITION: expected 3 components");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["componentType"] = 7; }),
              "accessor 0: unknown type of components 7");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0].erase("bufferView"); }), "bufferView is missing");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["sparse"] = Json::object(); }),
              "sparse accessors are not read");
    EXPECT_EQ(refusal_of([](Json& j) { j["bufferViews"][0]["byteLength"] = 1u << 31; }),
              "bufferView 0: 2147483648 bytes from byte 0 on, found 60 in all");
    EXPECT_EQ(refusal_of([](Json& j) { j["bufferViews"][0]["byteStride"] = 4; }),
              "accessor 0: 4 values of 12 bytes, found 48 bytes");
    EXPECT_EQ(refusal_of([](Json& j) { j["buffers"][0]["uri"] = "other.bin"; }),
              "values outside the file's own chunk are not read");
    EXPECT_EQ(refusal_of([](Json& j) { j["meshes"][0]["primitives"][0]["indices"] = 0; }),
              "accessor 0: indices are no whole numbers");
    EXPECT_EQ(refusal_of([](Json& j) { j["meshes"][0]["primitives"][0]["indices"] = 5; }),
              "names number 5 of 2 accessors");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][1]["count"] = 5; }),
              "5 corners, which is no multiple of 3");
    EXPECT_EQ(refusal_of([](Json& j) { j["accessors"][0]["count"] = 3; }), "a corner names vertex 3 of 3");
    EXPECT_EQ(refusal_of([](Json& j) { j["meshes"][0]["primitives"][0]["attributes"]["_a"] = 1; }),
              "'_a': 6 values for 4 vertices");
    EXPECT_EQ(refusal_of([](Json& j) { j["nodes"][0]["children"] = {0}; }), "node 0 is in the scene twice");
    EXPECT_EQ(refusal_of([](Json& j) { j["nodes"][0]["mesh"] = 3; }), "names number 3 of 1 meshes");
    EXPECT_EQ(refusal_of([](Json& j) { j["nodes"][0]["scale"] = {1, 2}; }), "scale: expected 3 numbers");
    EXPECT_EQ(refusal_of([](Json& j) {
                  j["nodes"][0]["scale"] = {1e300, 1, 1};
              }),
              "vertex 1 has a coordinate that is not a finite number");
    EXPECT_EQ(refusal_of([](Json& j) { j["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }),
              "needs the extension 'KHR_draco_mesh_compression', which is not read");
    EXPECT_EQ(refusal_of([](Json& j) { j["nodes"] = 3; }), "nodes: expected a list");
    EXPECT_EQ(refusal_of([](Json& j) { j["nodes"] = {3}; }), "number 0 of the nodes is no object");
}
