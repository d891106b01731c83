// Meshes come back from each format as they went in, and every variant of a format is understood.
#include "converters/mesh_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <thread>
#include <tuple>

#include "tests/support/data.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::data_folder;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;

namespace {

using Bits = std::array<std::uint32_t, 3>;

std::uint32_t bits(float value) {
    std::uint32_t b;
    std::memcpy(&b, &value, sizeof b);
    return b;
}

Bits bits(const Vec3f& p) { return {bits(p[0]), bits(p[1]), bits(p[2])}; }

std::vector<Bits> point_bits(const TriMesh& mesh) {
    std::vector<Bits> all;
    for (const Vec3f& p : mesh.points) all.push_back(bits(p));
    return all;
}

/// The bits of the corners of each triangle: what STL keeps of a mesh.
std::vector<Bits> corner_bits(const TriMesh& mesh) {
    std::vector<Bits> all;
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t) all.push_back(bits(mesh.points[v]));
    return all;
}

std::vector<std::uint32_t> value_bits(const MeshProperty& property) {
    std::vector<std::uint32_t> all;
    for (const float v : property.values) all.push_back(bits(v));
    return all;
}

void expect_same_properties(const std::vector<MeshProperty>& a, const std::vector<MeshProperty>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].name, b[i].name);
        EXPECT_EQ(a[i].components, b[i].components);
        EXPECT_EQ(value_bits(a[i]), value_bits(b[i])) << a[i].name;
    }
}

/// Coordinates that are hard to keep: denormals, -0, the extremes, random bits.
TriMesh awkward_mesh() {
    using Limits = std::numeric_limits<float>;
    TriMesh mesh;
    mesh.points = {Vec3f(0.0f, -0.0f, 0.0f),
                   Vec3f(Limits::denorm_min(), -Limits::denorm_min(), 1e-40f),
                   Vec3f(1e-38f, Limits::min(), -Limits::min()),
                   Vec3f(Limits::max(), Limits::lowest(), 1.0f),
                   Vec3f(0.1f, 1.0f / 3.0f, 16777216.0f),
                   Vec3f(std::nextafter(1.0f, 2.0f), std::nextafter(1.0f, 0.0f), 123456789.0f)};
    std::mt19937 random(7);
    while (mesh.points.size() < 3000) {
        Vec3f p;
        for (float& c : p) do {
                const std::uint32_t b = static_cast<std::uint32_t>(random());
                std::memcpy(&c, &b, sizeof c);
            } while (!std::isfinite(c));
        mesh.points.push_back(p);
    }
    mesh.triangles = {{0, 1, 2}, {2, 1, 3}, {3, 4, 5}, {0, 0, 1}};  // the last is degenerate, and stays
    const auto vertex = [&] { return static_cast<VertexId>(random() % mesh.points.size()); };
    for (int f = 0; f < 5000; ++f) mesh.triangles.push_back({vertex(), vertex(), vertex()});
    return mesh;
}

void add_properties(TriMesh& mesh) {
    std::mt19937 random(11);
    const auto fill = [&](std::vector<MeshProperty>& properties, const char* name, int components,
                          std::size_t elements) {
        MeshProperty p{name, components, {}};
        for (std::size_t i = 0; i < elements * static_cast<std::size_t>(components); ++i)
            p.values.push_back(static_cast<float>(random()) * 1e-6f - 2000);
        p.values[0] = -0.0f;
        p.values.back() = std::numeric_limits<float>::infinity();
        properties.push_back(p);
    };
    for (const char* name : {"K", "H", "k1", "k2", "shape_index", "curvedness", "type"})
        fill(mesh.vertex_properties, name, 1, mesh.points.size());
    fill(mesh.vertex_properties, "direction_1", 3, mesh.points.size());
    fill(mesh.vertex_properties, "normal", 3, mesh.points.size());
    fill(mesh.vertex_properties, "H_x", 1, mesh.points.size());  // alone: no vector
    fill(mesh.face_properties, "area", 1, mesh.triangles.size());
    fill(mesh.face_properties, "normal", 3, mesh.triangles.size());
    fill(mesh.face_properties, "region", 1, mesh.triangles.size());
}

/// Reads `text` as a file of this name.
TriMesh read_text(const std::string& text, const std::string& name) {
    const TempFolder folder;
    write_bytes(folder / name, text);
    return read_mesh(folder / name);
}

std::vector<float> coordinates(const TriMesh& mesh) {
    std::vector<float> all;
    for (const Vec3f& p : mesh.points) all.insert(all.end(), p.begin(), p.end());
    return all;
}

std::vector<VertexId> corners(const TriMesh& mesh) {
    std::vector<VertexId> all;
    for (const Triangle& t : mesh.triangles) all.insert(all.end(), t.begin(), t.end());
    return all;
}

bool closed(const TriMesh& mesh) {
    std::map<std::pair<VertexId, VertexId>, int> edges;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax({t[k], t[(k + 1) % 3]})];
    return std::all_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 2; });
}

/// `value` with its bytes in this order.
template <class T>
std::string binary(T value, bool big_endian) {
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    if (big_endian) std::reverse(bytes.begin(), bytes.end());
    return bytes;
}

const std::vector<float> square = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
const std::vector<VertexId> square_fan = {0, 1, 2, 0, 2, 3};

}  // namespace

TEST(MeshFile, EachFormatKeepsEveryBit) {
    const TriMesh mesh = awkward_mesh();
    const TempFolder folder;
    for (const std::string& ending : mesh_endings()) {
        SCOPED_TRACE(ending);
        write_mesh(mesh, folder / ("m" + ending));
        const TriMesh back = read_mesh(folder / ("m" + ending));
        EXPECT_EQ(corner_bits(back), corner_bits(mesh));
        if (ending == ".stl") continue;
        EXPECT_EQ(point_bits(back), point_bits(mesh));
        EXPECT_EQ(back.triangles, mesh.triangles);
    }
}

TEST(MeshFile, PlyKeepsProperties) {
    TriMesh mesh = awkward_mesh();
    add_properties(mesh);
    const TempFolder folder;
    write_mesh(mesh, folder / "m.ply");
    const TriMesh back = read_mesh(folder / "m.ply");
    EXPECT_EQ(point_bits(back), point_bits(mesh));
    EXPECT_EQ(back.triangles, mesh.triangles);
    expect_same_properties(back.vertex_properties, mesh.vertex_properties);
    expect_same_properties(back.face_properties, mesh.face_properties);
}

TEST(MeshFile, VtkKeepsProperties) {
    TriMesh mesh = awkward_mesh();
    add_properties(mesh);
    mesh.vertex_properties.push_back({"five <&> parts", 5, std::vector<float>(5 * mesh.points.size(), 0.5f)});
    mesh.face_properties.push_back({"color", 3, std::vector<float>(3 * mesh.triangles.size(), 0.3f)});
    const TempFolder folder;
    for (const char* name : {"m.vtp", "m.vtu"}) {
        write_mesh(mesh, folder / name);
        const TriMesh back = read_mesh(folder / name);
        expect_same_properties(back.vertex_properties, mesh.vertex_properties);
        expect_same_properties(back.face_properties, mesh.face_properties);
    }
}

TEST(MeshFile, GlbKeepsPropertiesOfVertices) {
    TriMesh mesh = awkward_mesh();
    add_properties(mesh);
    mesh.vertex_properties.push_back({"a b", 2, std::vector<float>(2 * mesh.points.size(), 0.5f)});
    const TempFolder folder;
    write_mesh(mesh, folder / "m.glb");
    expect_same_properties(read_mesh(folder / "m.glb").vertex_properties, mesh.vertex_properties);
    mesh.vertex_properties = {{"five", 5, std::vector<float>(5 * mesh.points.size())}};
    for (std::size_t i = 0; i < mesh.vertex_properties[0].values.size(); ++i)
        mesh.vertex_properties[0].values[i] = static_cast<float>(i);
    write_mesh(mesh, folder / "m.glb");
    const TriMesh back = read_mesh(folder / "m.glb");
    ASSERT_EQ(back.vertex_properties.size(), 5u);
    EXPECT_EQ(back.find_vertex_property("five_3")->values[2], 13);
}

TEST(MeshFile, VertexColours) {
    TriMesh mesh;
    mesh.points = {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
    mesh.triangles = {{0, 1, 2}};
    std::vector<float> bytes;
    for (const int b : {0, 255, 1, 254, 127, 128, 51, 3, 77})
        bytes.push_back(static_cast<float>(b) * (1.0f / 255));
    mesh.vertex_properties = {{"H", 1, {1, 2, 3}}, {"color", 3, bytes}, {"K", 1, {4, 5, 6}}};
    mesh.face_properties = {{"color", 3, {1, 0, 1}}};
    const TempFolder folder;
    for (const char* ending : {".ply", ".obj", ".off", ".vtp", ".vtu", ".glb"}) {
        SCOPED_TRACE(ending);
        const auto file = folder / (std::string("m") + ending);
        write_mesh(mesh, file);
        const TriMesh back = read_mesh(file);
        ASSERT_NE(back.find_vertex_property("color"), nullptr);
        EXPECT_EQ(back.find_vertex_property("color")->values, bytes);
    }
    EXPECT_NE(
        read_bytes(folder / "m.ply").find("property uchar red\nproperty uchar green\nproperty uchar blue\n"),
        std::string::npos);
    const TriMesh ply = read_mesh(folder / "m.ply");
    expect_same_properties(ply.vertex_properties, mesh.vertex_properties);
    expect_same_properties(ply.face_properties, mesh.face_properties);
    // What is no colour is clipped.
    mesh.vertex_properties = {{"color", 3, {-1, 2, NAN, 0, 0, 0, 0, 0, 0}}};
    write_mesh(mesh, folder / "m.obj");
    EXPECT_NE(read_bytes(folder / "m.obj").find("v 0 0 0 0 1 0\n"), std::string::npos);
    write_mesh(mesh, folder / "m.ply");
    EXPECT_EQ(read_mesh(folder / "m.ply").vertex_properties[0].values[1], 1);
    // A property of that name and another shape is none.
    mesh.vertex_properties = {{"color", 1, {7, 8, 9}}};
    for (const char* ending : {".ply", ".vtp", ".glb"}) {
        write_mesh(mesh, folder / (std::string("n") + ending));
        expect_same_properties(read_mesh(folder / (std::string("n") + ending)).vertex_properties,
                               mesh.vertex_properties);
    }
}

TEST(MeshFile, ColoursOfOtherPrograms) {
    const std::string faces = "3 0 1 2\n";
    const auto color = [](const TriMesh& mesh) { return mesh.find_vertex_property("color")->values[1]; };
    EXPECT_EQ(color(read_text("COFF\n3 1 0\n0 0 0 0 51 255 255\n1 0 0 0 0 0 255\n0 1 0 1 2 3 4\n" + faces,
                              "m.off")),
              51 * (1.0f / 255));
    EXPECT_EQ(color(read_text(
                  "CNOFF\n3 1 0\n0 0 0 0 0 1 0 0.25 1 1\n1 0 0 0 0 1 0 0 0 1\n0 1 0 0 0 1 1 0 1 1\n" + faces,
                  "m.off")),
              0.25f);
    const std::string head =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\n";
    for (const auto& [type, values, green] :
         {std::tuple("uchar", "0 51 0", 51 * (1.0f / 255)),
          std::tuple("ushort", "0 13107 0", 13107 * (1.0f / 65535)), std::tuple("float", "0 0.5 0", 0.5f)}) {
        std::string text = head;
        for (const char* name : {"red", "green", "blue"})
            text += std::string("property ") + type + " " + name + "\n";
        const TriMesh mesh =
            read_text(text + "property uchar alpha\nend_header\n0 0 0 " + values + " 9\n", "m.ply");
        EXPECT_EQ(color(mesh), green);
        EXPECT_EQ(mesh.find_vertex_property("alpha")->values[0], 9);
    }
    // Not all vertices of an OBJ file have one: none has.
    EXPECT_TRUE(
        read_text("v 0 0 0 1 1 1\nv 1 0 0\nv 0 1 0 1 1 1\nf 1 2 3\n", "m.obj").vertex_properties.empty());
    EXPECT_TRUE(
        read_text("v 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nf 1 2 3\n", "m.obj").vertex_properties.empty());
    EXPECT_TRUE(read_text("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n", "m.obj").vertex_properties.empty());
}

TEST(MeshFile, SecondWriteGivesTheSameBytesForAnyThreadCount) {
    TriMesh mesh = awkward_mesh();
    while (mesh.triangles.size() < 600000)
        mesh.triangles.push_back(mesh.triangles[mesh.triangles.size() % 5000]);
    const TempFolder folder;
    for (const std::string& ending : mesh_endings()) {
        const auto written = [&](const std::string& name, std::size_t threads) {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
            write_mesh(mesh, folder / (name + ending));
            return read_bytes(folder / (name + ending));
        };
        EXPECT_TRUE(written("a", 1) == written("b", 4)) << ending;
        EXPECT_EQ(read_mesh(folder / ("a" + ending)).triangles.size(), mesh.triangles.size());
    }
}

TEST(MeshFile, EmptyMeshesAreMeshes) {
    TriMesh points_only;
    points_only.points = {Vec3f(1, 2, 3), Vec3f(4, 5, 6)};
    const TempFolder folder;
    for (const TriMesh& mesh : {TriMesh(), points_only})
        for (const std::string& ending : mesh_endings()) {
            write_mesh(mesh, folder / ("m" + ending));
            const TriMesh back = read_mesh(folder / ("m" + ending));
            EXPECT_TRUE(back.empty()) << ending;
            EXPECT_EQ(back.points.size(), ending == ".stl" ? 0 : mesh.points.size()) << ending;
        }
}

TEST(MeshFile, EndingsAreTakenInUpperCaseAndNamedOtherwise) {
    EXPECT_EQ(mesh_endings(),
              (std::vector<std::string>{".ply", ".obj", ".off", ".stl", ".vtp", ".vtu", ".glb"}));
    EXPECT_TRUE(is_mesh_ending("a/b.STL"));
    EXPECT_TRUE(is_mesh_ending("b.ply"));
    EXPECT_FALSE(is_mesh_ending("ply"));
    EXPECT_FALSE(is_mesh_ending("a.ply/b"));
    EXPECT_FALSE(is_mesh_ending("a.mrc"));
    try {
        write_mesh(TriMesh(), "m.mrc");
        FAIL();
    } catch (const InvalidInput& error) {
        EXPECT_STREQ(
            error.what(),
            "m.mrc: not the name of a mesh file: expected an ending among .ply, .obj, .off, .stl, .vtp, "
            ".vtu, .glb");
    }
}

TEST(MeshFile, DigitsRoundTheTextFormats) {
    TriMesh mesh;
    mesh.points = {Vec3f(1.0f / 3, 2e7f / 3, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
    mesh.triangles = {{0, 1, 2}};
    const TempFolder folder;
    MeshWriteOptions options;
    options.digits = 3;
    write_mesh(mesh, folder / "m.obj", options);
    EXPECT_EQ(read_bytes(folder / "m.obj"),
              "# vdbgeo, coordinates in Angstrom\nv 0.333 6.67e+06 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_mesh(mesh, folder / "m.off");
    EXPECT_EQ(read_bytes(folder / "m.off"), "OFF\n3 1 0\n0.33333334 6666666.5 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    for (const int digits : {0, 10}) {
        options.digits = digits;
        EXPECT_THROW(write_mesh(mesh, folder / "m.obj", options), InvalidInput);
    }
}

TEST(MeshFile, ContentGoesBeforeTheEnding) {
    const std::string off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    EXPECT_EQ(read_text(off, "m.stl").triangles.size(), 1u);
    EXPECT_EQ(read_text(off, "nothing").triangles.size(), 1u);
    TriMesh mesh;
    mesh.points = {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
    mesh.triangles = {{0, 1, 2}};
    const TempFolder folder;
    write_mesh(mesh, folder / "m.ply");
    std::filesystem::rename(folder / "m.ply", folder / "m.obj");
    EXPECT_EQ(read_mesh(folder / "m.obj").triangles, mesh.triangles);
    // The 80 free bytes of a binary STL file may begin like another format, or with "solid".
    write_mesh(mesh, folder / "m.stl");
    for (const std::string word : {"ply ", "OFF ", "solid "}) {
        std::string bytes = read_bytes(folder / "m.stl");
        write_bytes(folder / "n.stl", bytes.replace(0, word.size(), word));
        EXPECT_EQ(read_mesh(folder / "n.stl").triangles, mesh.triangles) << word;
    }
}

TEST(MeshFile, PipesAreRead) {
    const TriMesh mesh = awkward_mesh();
    const TempFolder folder;
    for (const std::string& ending : mesh_endings()) {
        const std::filesystem::path file = folder / ("m" + ending), pipe = folder / ("pipe" + ending);
        write_mesh(mesh, file);
        ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
        std::thread writer([&] { write_bytes(pipe, read_bytes(file)); });
        const TriMesh back = read_mesh(pipe);
        writer.join();
        EXPECT_EQ(corner_bits(back), corner_bits(mesh)) << ending;
    }
}

TEST(MeshFile, ProgressCancelsReadingAndWriting) {
    TriMesh mesh = awkward_mesh();
    const TempFolder folder;
    const Progress stop([](double) { return false; });
    for (const std::string& ending : mesh_endings()) {
        write_bytes(folder / ("m" + ending), "old");
        EXPECT_THROW(write_mesh(mesh, folder / ("m" + ending), {}, stop), Cancelled) << ending;
        EXPECT_EQ(read_bytes(folder / ("m" + ending)), "old");
        write_mesh(mesh, folder / ("m" + ending));
        EXPECT_THROW(read_mesh(folder / ("m" + ending), stop), Cancelled) << ending;
    }
}

TEST(MeshFile, PlyAsciiWithOtherElementsListsAndPolygons) {
    const TriMesh mesh = read_text(
        "ply\nformat ascii 1.0\ncomment made by hand\nobj_info none\n"
        "element camera 1\nproperty float view\nproperty list uchar int ids\n"
        "element vertex 5\nproperty uchar red\nproperty double y\nproperty float x\nproperty int z\n"
        "property list uchar float weights\nproperty float dir_x\nproperty float dir_y\nproperty float "
        "dir_z\n"
        "property float nx\nproperty float ny\n"
        "element face 2\nproperty short label\nproperty list uchar uint vertex_index\n"
        "property list uchar float texcoord\nproperty float q\n"
        "end_header\n"
        "7.5 3 1 2 3\n"
        "\n255 0 0 0 0 1 2 3 8 9\n 1\t0 1 0 2 5 6 4 5 6 8 9 \n2 1 1 0 0 0 0 0 0 0\n3 1 0 0 0 0 0 0 0 0\n"
        "4 2 +.5 0 0 0 0 0 -0 1e-2\n"
        "-3 4 0 1 2 3 2 0.5 0.5 0.25\n"
        "300 3 3 2 4 0 7",
        "m.ply");
    EXPECT_EQ(coordinates(mesh), (std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 2, 0}));
    EXPECT_EQ(corners(mesh), (std::vector<VertexId>{0, 1, 2, 0, 2, 3, 3, 2, 4}));
    ASSERT_EQ(mesh.vertex_properties.size(), 4u);
    EXPECT_EQ(mesh.find_vertex_property("red")->values, (std::vector<float>{255, 1, 2, 3, 4}));
    EXPECT_EQ(mesh.find_vertex_property("dir")->components, 3);
    EXPECT_EQ(mesh.find_vertex_property("dir")->values[4], 5);
    EXPECT_EQ(mesh.find_vertex_property("nx")->components, 1);  // nz is missing
    EXPECT_EQ(mesh.find_vertex_property("ny")->values[4], 0.01f);
    EXPECT_EQ(mesh.find_face_property("label")->values, (std::vector<float>{-3, -3, 300}));
    EXPECT_EQ(mesh.find_face_property("q")->values, (std::vector<float>{0.25, 0.25, 7}));
}

TEST(MeshFile, PlyBinaryOfBothByteOrdersAndEveryType) {
    for (const bool big : {false, true}) {
        std::string file =
            std::string("ply\r\nformat binary_") + (big ? "big" : "little") +
            "_endian 1.0\r\nelement vertex 3\r\nproperty double x\r\nproperty int16 y\r\n"
            "property float32 z\r\nproperty char a\r\nproperty uint8 b\r\nproperty ushort c\r\n"
            "property int d\r\nproperty uint32 e\r\nproperty list short double l\r\n"
            "element face 1\r\nproperty list int uint16 vertex_indices\r\nend_header\r\n";
        for (int i = 0; i < 3; ++i) {
            file +=
                binary(i + 0.5, big) + binary(static_cast<std::int16_t>(-i), big) + binary(i * 1e-40f, big);
            file += binary(static_cast<std::int8_t>(-100), big) + binary(static_cast<std::uint8_t>(200), big);
            file += binary(static_cast<std::uint16_t>(60000), big) + binary(-1000000, big) +
                    binary(4000000000u, big);
            file += binary(static_cast<std::int16_t>(i), big);
            for (int k = 0; k < i; ++k) file += binary(1.0, big);
        }
        file += binary(3, big);
        for (const std::uint16_t v : {2, 0, 1}) file += binary(v, big);
        const TriMesh mesh = read_text(file, "m.ply");
        EXPECT_EQ(coordinates(mesh), (std::vector<float>{0.5, 0, 0, 1.5, -1, 1e-40f, 2.5, -2, 2 * 1e-40f}));
        EXPECT_EQ(corners(mesh), (std::vector<VertexId>{2, 0, 1}));
        const std::map<std::string, float> expected = {
            {"a", -100}, {"b", 200}, {"c", 60000}, {"d", -1e6}, {"e", 4e9}};
        for (const auto& [name, value] : expected)
            EXPECT_EQ(mesh.find_vertex_property(name)->values, std::vector<float>(3, value)) << name;
        EXPECT_EQ(mesh.vertex_properties.size(), 5u);
    }
}

TEST(MeshFile, PlyBodyMayBeginWithTheByteOfALineEnd) {
    // x of the first vertex begins with LF; the header's lines end with CR alone, then with LF
    for (const std::string end : {"\r", "\n", "\r\n"}) {
        std::string file =
            "ply|format binary_little_endian 1.0|element vertex 1|property float x|property float y|"
            "property float z|end_header|";
        for (std::size_t at = file.find('|'); at != file.npos; at = file.find('|')) file.replace(at, 1, end);
        const std::uint32_t x = 0x3F800A0A;
        const TriMesh mesh = read_text(file + binary(x, false) + std::string(8, '\0'), "m.ply");
        ASSERT_EQ(mesh.points.size(), 1u);
        EXPECT_EQ(bits(mesh.points[0][0]), x);
    }
}

TEST(MeshFile, ObjCornersInEveryForm) {
    const std::string vertices = "v 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0 1\nvt 0 0\nvn 0 0 1\n";
    for (const char* face :
         {"f 1 2 3 4", "f 1/1 2/1 3/1 4/1", "f 1//1 2//1 3//1 4//1", "f 1/1/1 2/1/1 3/1/1 4/1/1",
          "f -4 -3 -2 -1", "f -4/-1/-1 2//-1 3 -1/1", "f 1 2 \\\n 3 4", "f\t+1  2 3 4 # a remark"}) {
        const TriMesh mesh =
            read_text("\xEF\xBB\xBF# made by hand\nmtllib x\no thing\n" + vertices + face, "m.obj");
        EXPECT_EQ(coordinates(mesh), square) << face;
        EXPECT_EQ(corners(mesh), square_fan) << face;
    }
    const TriMesh ahead = read_text("f 1 2 3\r\ng a\r\nv 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\n", "m.obj");
    EXPECT_EQ(corners(ahead), (std::vector<VertexId>{0, 1, 2}));
}

TEST(MeshFile, OffInEveryForm) {
    const std::string plain = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    for (const std::string& text :
         {"OFF\n4 1 0\n" + plain, "OFF 4 1 4\n" + plain, "OFF4 1 0\n" + plain, "4 1 0\n" + plain,
          "# first\n\nOFF # second\n# third\n4 1\n" + plain, "OFF\r\n4\t1 0\r\n" + plain,
          std::string("COFF\n4 1 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n1 1 0 0 0 0 0\n0 1 0 9 9 9 9\n4 0 1 2 "
                      "3 0.5 0.5 0\n")}) {
        const TriMesh mesh = read_text(text, "m.off");
        EXPECT_EQ(coordinates(mesh), square) << text;
        EXPECT_EQ(corners(mesh), square_fan) << text;
        EXPECT_EQ(mesh.vertex_properties.empty(), text[0] != 'C');
    }
    const TriMesh normals = read_text("NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 1 0\n1 1 0 1 0 0\n3 0 1 2", "m.off");
    ASSERT_NE(normals.find_vertex_property("normal"), nullptr);
    EXPECT_EQ(normals.find_vertex_property("normal")->values,
              (std::vector<float>{0, 0, 1, 0, 1, 0, 1, 0, 0}));
}

TEST(MeshFile, TextNumbersAtTheEndsOfTheRange) {
    const TriMesh mesh = read_text("v 1e-50 -1e-400 1e-45\nv 3.4028235e38 -1.17549435E-38 .1e1\n", "m.obj");
    EXPECT_EQ(point_bits(mesh),
              (std::vector<Bits>{{bits(0.0f), bits(-0.0f), 1}, {0x7F7FFFFF, 0x80800000, bits(1.0f)}}));
}

TEST(MeshFile, StlTextIsMergedByBitsInOrderOfAppearance) {
    const TriMesh mesh = read_text(
        "solid a b c\n facet normal 0 0 1\n  OUTER LOOP\n   vertex 5 0 0\n   vertex 1 0 0\n   vertex 0 1e0 "
        "0\n"
        "  endloop\n endfacet\n FACET normal nan nan nan\n  outer loop\n   vertex 0 1 0\n   vertex 1.0 0 0\n"
        "   vertex -0 0 7\n  endloop\n endfacet\nendsolid a b c\n"
        "solid second\nfacet normal 0 0 0\nouter loop\nvertex 0 0 7\nvertex 5 0 0\nvertex 5 0 "
        "0\nendloop\nendfacet\n"
        "endsolid\n",
        "m.stl");
    EXPECT_EQ(coordinates(mesh), (std::vector<float>{5, 0, 0, 1, 0, 0, 0, 1, 0, -0.0f, 0, 7, 0, 0, 7}));
    EXPECT_EQ(corners(mesh), (std::vector<VertexId>{0, 1, 2, 2, 1, 3, 4, 0, 0}));
    EXPECT_TRUE(read_text("solid nothing\nendsolid nothing\n", "m.stl").empty());
}

TEST(MeshFile, StlNormalsAreUnitAndZeroWithoutArea) {
    TriMesh mesh;
    mesh.points = {Vec3f(0, 0, 0), Vec3f(3e38f, 0, 0), Vec3f(0, 3e38f, 0)};
    mesh.triangles = {{0, 1, 2}, {0, 1, 1}, {2, 1, 0}};
    const TempFolder folder;
    write_mesh(mesh, folder / "m.stl");
    const std::string bytes = read_bytes(folder / "m.stl");
    ASSERT_EQ(bytes.size(), 84u + 3 * 50);
    for (const auto& [facet, z] : {std::pair(0, 1.0f), std::pair(1, 0.0f), std::pair(2, -1.0f)}) {
        Vec3f normal;
        std::memcpy(normal.data(), bytes.data() + 84 + 50 * facet, 12);
        EXPECT_EQ(normal, Vec3f(0, 0, z));
    }
}

struct RealMesh {
    const char* file;
    std::size_t vertices, triangles;
};

class RealMeshes : public testing::TestWithParam<RealMesh> {};

TEST_P(RealMeshes, HaveTheirCountsAreClosedAndComeBack) {
    const auto [file, vertices, triangles] = GetParam();
    VDBGEO_NEEDS_DATA(file);
    const TriMesh mesh = read_mesh(data_folder() / file);
    EXPECT_EQ(mesh.points.size(), vertices);
    EXPECT_EQ(mesh.triangles.size(), triangles);
    EXPECT_TRUE(closed(mesh));
    const TempFolder folder;
    for (const std::string& ending : mesh_endings()) {
        write_mesh(mesh, folder / ("m" + ending));
        const TriMesh back = read_mesh(folder / ("m" + ending));
        EXPECT_EQ(corner_bits(back), corner_bits(mesh)) << ending;
        EXPECT_TRUE(closed(back)) << ending;
    }
}

// Counted with a script of a few lines that shares nothing with this reader; VTK's readers agree.
INSTANTIATE_TEST_SUITE_P(MeshFile, RealMeshes,
                         testing::Values(RealMesh{"trimesh/torus.STL", 4350, 8700},
                                         RealMesh{"trimesh/unit_sphere.STL", 642, 1280},
                                         RealMesh{"trimesh/quadknot.obj", 1440, 2880},
                                         RealMesh{"ftetwild/bunny.off", 3485, 6966},
                                         RealMesh{"sfftk_mesh/test_data_multi0.stl", 2248, 4532},
                                         RealMesh{"pycurv_embryo/cell_10_T_10.ply", 727, 1450}),
                         [](const auto& test) {
                             std::string name = test.param.file;
                             for (char& c : name)
                                 if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                             return name;
                         });

TEST(MeshFile, RealPlyOfBigEndianBytesHasItsValues) {
    VDBGEO_NEEDS_DATA("pycurv_embryo/cell_10_T_10.ply");
    const TriMesh mesh = read_mesh(data_folder() / "pycurv_embryo/cell_10_T_10.ply");
    EXPECT_EQ(mesh.points[0], Vec3f(218.25100708007812f, 84.46688079833984f, 65.25908660888672f));
    EXPECT_EQ(mesh.triangles[0], (Triangle{640, 356, 341}));
    const MeshProperty* const normal = mesh.find_vertex_property("normal");
    ASSERT_NE(normal, nullptr);
    ASSERT_EQ(normal->values.size(), 3u * 727);
    EXPECT_EQ(normal->values[3 * 726 + 2], -0.27837705612182617f);
}

TEST(MeshFile, RealPlyOfNoVertexIsAnEmptyMesh) {
    VDBGEO_NEEDS_DATA("pycurv_embryo/cell_10_T_19.ply");
    const TriMesh mesh = read_mesh(data_folder() / "pycurv_embryo/cell_10_T_19.ply");
    EXPECT_TRUE(mesh.empty());
    EXPECT_TRUE(mesh.points.empty());
    EXPECT_NE(mesh.find_vertex_property("normal"), nullptr);
}
