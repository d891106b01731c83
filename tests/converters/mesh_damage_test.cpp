// Damaged mesh files are refused with one line that names the place.
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <random>

#include "converters/mesh_file.h"
#include "converters/mesh_formats.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;

namespace {

/// What the refusal of `content` says behind the file's name; a note where it is not refused.
std::string refusal(const std::string& content, const std::string& name) {
    const TempFolder folder;
    write_bytes(folder / name, content);
    try {
        read_mesh(folder / name);
    } catch (const InvalidInput& error) {
        const std::string text = error.what(), prefix = (folder / name).string() + ": ";
        EXPECT_EQ(text.find('\n'), text.npos) << text;
        EXPECT_EQ(text.substr(0, prefix.size()), prefix);
        return text.substr(std::min(prefix.size(), text.size()));
    }
    return "(not refused)";
}

struct Damage {
    const char* defect;
    std::string content;
    const char* message;
};

void expect_refused(const std::vector<Damage>& cases, const std::string& name) {
    for (const Damage& damage : cases)
        EXPECT_EQ(refusal(damage.content, name), damage.message) << damage.defect;
}

const std::string xyz = "property float x\nproperty float y\nproperty float z\n";

std::string ply(const std::string& encoding, const std::string& declarations, const std::string& body) {
    return "ply\nformat " + encoding + " 1.0\n" + declarations + "end_header\n" + body;
}

std::string ascii_faces(const std::string& body) {
    return ply("ascii",
               "element vertex 3\n" + xyz + "element face 1\nproperty list uchar int vertex_indices\n", body);
}

TriMesh tetrahedron() {
    TriMesh mesh;
    mesh.points = {Vec3f(0, 0, 0), Vec3f(1.5f, 0, 0), Vec3f(0, 1.25f, 0), Vec3f(0, 0, 1e-3f)};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    mesh.vertex_properties.push_back({"K", 1, {1, 2, 3, 4}});
    mesh.face_properties.push_back({"area", 1, {1, 2, 3, 4}});
    return mesh;
}

}  // namespace

TEST(MeshDamage, AnyFormat) {
    const TempFolder folder;
    EXPECT_THROW(read_mesh(folder / "none.ply"), IoError);
    EXPECT_THROW(read_mesh(folder.path()), IoError);
    for (const std::string& ending : mesh_endings())
        EXPECT_EQ(refusal("", "m" + ending), "the file is empty");
    EXPECT_EQ(refusal("hello", "m.txt"),
              "not a mesh: the content is none of PLY, OFF, glTF and VTK, and the ending none of .ply, .obj, "
              ".off, .stl, "
              ".vtp, .vtu, .glb");
}

TEST(MeshDamage, PlyHeaders) {
    const std::string vertex = "ply\nformat ascii 1.0\nelement vertex 1\n";
    expect_refused(
        {{"garbage", "plx\n", "line 1: expected the word ply at the file's beginning"},
         {"nothing more", "ply\n", "line 2: expected end_header, found the end of the file"},
         {"cut header", vertex + "property float x",
          "line 4: expected end_header, found the end of the file"},
         {"unknown word", "ply\nform\x01t ascii 1.0\n",
          "line 2: expected format, element, property, comment or end_header, found 'form.t'"},
         {"unknown encoding", "ply\nformat middle_endian 1.0\n",
          "line 2: expected ascii, binary_little_endian or binary_big_endian, found 'middle_endian'"},
         {"version", "ply\nformat ascii 2.0\n", "line 2: expected version 1.0, found '2.0'"},
         {"no format", "ply\nelement vertex 0\n" + xyz + "end_header\n",
          "line 6: the header has no line 'format'"},
         {"unknown type", vertex + "property quaternion x\n",
          "line 4: expected a type such as float, int or uchar, found 'quaternion'"},
         {"float length", vertex + "property list float int a\n",
          "line 4: the length of a list is no whole number"},
         {"no name", vertex + "property float\n", "line 4: a property without a name"},
         {"twice", vertex + "property float x\nproperty int x\n", "line 5: property 'x' is declared twice"},
         {"early property", "ply\nformat ascii 1.0\nproperty int x\n",
          "line 3: a property before any element"},
         {"element twice", vertex + "element vertex 1\n", "line 4: element 'vertex' is declared twice"},
         {"negative count", "ply\nformat ascii 1.0\nelement vertex -1\n",
          "line 3: element 'vertex': expected a count, found -1"},
         {"binary field", "ply\nformat ascii 1.0\nelement vertex \x03\x7F\n",
          "line 3: count of the element: expected a whole number, found '..'"},
         {"no vertices", ply("ascii", "element face 0\nproperty list uchar int vertex_indices\n", ""),
          "the header declares no element 'vertex'"},
         {"no z", ply("ascii", "element vertex 1\nproperty float x\nproperty float y\n", "0 0\n"),
          "line 3: element 'vertex': no property 'z'"},
         {"no corners", ply("ascii", "element vertex 0\n" + xyz + "element face 1\nproperty int a\n", "0\n"),
          "line 7: element 'face': no list 'vertex_indices' or 'vertex_index'"},
         {"float corners",
          ply("ascii", "element vertex 0\n" + xyz + "element face 1\nproperty list int float vertex_index\n",
              "3 0 0 0"),
          "line 7: element 'face': the corners are no whole numbers"},
         {"strips",
          ply("ascii",
              "element vertex 0\n" + xyz + "element tristrips 1\nproperty list int int vertex_indices\n",
              "0"),
          "line 7: element 'tristrips': triangle strips are not read"},
         {"no property", ply("ascii", "element vertex 0\n" + xyz + "element x 99999999999999\n", ""),
          "line 7: element 'x': no property"}},
        "m.ply");
}

TEST(MeshDamage, PlyCountsAreComparedWithTheFile) {
    const std::string kilobyte(900, '\0');
    expect_refused(
        {{"10^12 vertices", ply("binary_little_endian", "element vertex 1000000000000\n" + xyz, kilobyte),
          "line 3: element 'vertex': 1000000000000 entries need 12000000000000 bytes at least, found 900"},
         {"count times size beyond 64 bits",
          ply("binary_big_endian", "element vertex 9223372036854775807\n" + xyz, kilobyte),
          "line 3: element 'vertex': 9223372036854775807 entries need 18446744073709551615 bytes at least, "
          "found 900"},
         {"ascii", ply("ascii", "element vertex 151\n" + xyz, kilobyte),
          "line 3: element 'vertex': 151 entries need 906 bytes at least, found 900"},
         {"faces",
          ply("binary_little_endian",
              "element vertex 10\n" + xyz + "element face 1000\nproperty list uchar int vertex_indices\n",
              kilobyte),
          "line 7: element 'face': 1000 entries need 13000 bytes at least, found 780"},
         {"one byte short", ply("binary_little_endian", "element vertex 76\n" + xyz, std::string(911, '\0')),
          "line 3: element 'vertex': 76 entries need 912 bytes at least, found 911"},
         {"one entry more", ply("binary_little_endian", "element vertex 75\n" + xyz, std::string(911, '\0')),
          "byte 1016: expected the end of the file, found 11 bytes more"}},
        "m.ply");
}

TEST(MeshDamage, MoreVerticesThanNumbersAreRefused) {
    const TempFolder folder;  // a file full of holes, long enough for what it declares
    write_bytes(folder / "m.ply",
                ply("binary_little_endian",
                    "element vertex 4294967296\nproperty char x\nproperty char y\nproperty char z\n", ""));
    std::filesystem::resize_file(folder / "m.ply", 13000000000ull);
    try {
        read_mesh(folder / "m.ply");
        FAIL();
    } catch (const InvalidInput& error) {
        EXPECT_NE(std::string(error.what()).find("4294967296 vertices, more than 2^32-1"), std::string::npos);
    }
}

TEST(MeshDamage, PlyBodies) {
    const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
    expect_refused(
        {{"cut after the vertices", ascii_faces(points + "           \n"),
          "line 14: the file ends where entry 0 of 1 of element 'face' is expected"},
         {"a vertex cut", ascii_faces("0 0 0\n1 0  \n0 1 0\n3 0 1 2\n"), "line 11: z is missing"},
         {"a word", ascii_faces("0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n"),
          "line 11: z: expected a number, found 'zero'"},
         {"too many values", ascii_faces("0 0 0\n1 0 0 0\n0 1 0\n3 0 1 2\n"),
          "line 11: expected the end of the line, found '0'"},
         {"binary body", ascii_faces(std::string(49, '\x01')),
          "line 10: x: expected a number, found '........................................…'"},
         {"negative corner", ascii_faces(points + "3 0 -1 2\n"), "line 13: a corner names vertex -1 of 3"},
         {"corner past the end", ascii_faces(points + "3 0 1 3\n"), "line 13: a corner names vertex 3 of 3"},
         {"two corners", ascii_faces(points + "2 0 1          \n"),
          "line 13: expected a face of 3 to 255 corners, found 2"},
         {"implausible list", ascii_faces(points + "300 " + std::string(600, '1')),
          "line 13: expected a face of 3 to 255 corners, found 300"},
         {"list beyond the file", ascii_faces(points + "4000000 0 1 2\n"),
          "line 13: vertex_indices: a list of 4000000 values that the file is too short for"},
         {"negative list", ascii_faces(points + "-3 0 1 2\n"),
          "line 13: vertex_indices: a list of -3 values"},
         {"fraction", ascii_faces(points + "3 0 1 2.5\n"),
          "line 13: vertex_indices: expected a whole number, found '2.5'"},
         {"more entries", ascii_faces(points + "3 0 1 2\n3 0 1 2\n"),
          "line 14: expected the end of the file, found '3'"},
         {"NaN", ascii_faces("0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"),
          "vertex 1 has a coordinate that is not a finite number"},
         {"infinite", ascii_faces("0 0 0\n1 0 0\n0 1 1e39\n3 0 1 2\n"),
          "vertex 2 has a coordinate that is not a finite number"}},
        "m.ply");
}

TEST(MeshDamage, PlyBinaryLists) {
    const std::string head =
        "element vertex 1\n" + xyz + "element face 2\nproperty list char char vertex_indices\n";
    const std::string point(12, '\0');
    const auto body = [&](const std::string& faces) {
        return ply("binary_little_endian", head, point + faces);
    };
    expect_refused({{"negative list", body("\xFF" + std::string(7, '\0')),
                     "element 'face', entry 0, byte 181: vertex_indices: a list of -1 values"},
                    {"list beyond the file", body(std::string("\x03\0\0\0\x7F\0\0\0", 8)),
                     "element 'face', entry 1, byte 185: vertex_indices: a list of 127 bytes, found 3 to the "
                     "file's end"},
                    {"bad corner", body(std::string("\x03\0\0\0\x03\0\x01\0", 8)),
                     "element 'face', entry 1, byte 187: a corner names vertex 1 of 1"},
                    {"no entry left", body(std::string("\x07\0\0\0\0\0\0\0", 8)),
                     "element 'face', entry 1, byte 189: the file ends within this entry"}},
                   "m.ply");
}

TEST(MeshDamage, Obj) {
    const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    expect_refused(
        {{"garbage",
          std::string("\x7F"
                      "ELF\x02\x01",
                      6),
          "line 1: expected a statement of a polygon mesh, found '.ELF..'"},
         {"free-form surface", points + "surf 0 1 0 1 1\n",
          "line 4: expected a statement of a polygon mesh, found 'surf'"},
         {"short vertex", "v 0 0\n", "line 1: z is missing"},
         {"comma", "v 0,5 0 0\n", "line 1: x: expected a number, found '0,5'"},
         {"colour", "v 0 0 0 1 1 x\n", "line 1: colour: expected a number, found 'x'"},
         {"NaN", "v 0 0 0\nv 0 nan 0\n", "vertex 1 has a coordinate that is not a finite number"},
         {"zero", points + "f 0 1 2\n", "line 4: a corner names vertex 0 where there are 3 so far"},
         {"too far back", points + "f -1 -2 -4\n",
          "line 4: a corner names vertex -4 where there are 3 so far"},
         {"past the end", points + "f 1 2 4\nf 1 2 3\n", "line 4: a corner names vertex 4 of 3"},
         {"beyond 32 bits", points + "f 1 2 4294967297\n",
          "line 4: a corner names vertex 4294967297 where there are 3 so far"},
         {"beyond 64 bits", points + "f 1 2 99999999999999999999\n",
          "line 4: corner: expected a whole number, found '99999999999999999999'"},
         {"odd corner", points + "f 1/a 2 3\n",
          "line 4: expected a corner like 1, 1/1, 1//1 or 1/1/1, found '1/a'"},
         {"empty corner", points + "f /1 2 3\n", "line 4: corner: expected a whole number, found ''"},
         {"two corners", points + "f 1 2\n", "line 4: expected a face of 3 or more corners, found 2"},
         {"unfinished", points + "f 1 2 3 \\\n", "line 5: the file ends within a face"}},
        "m.obj");
}

TEST(MeshDamage, Off) {
    const std::string points = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n";
    expect_refused(
        {{"garbage", "hello\n", "line 1: count of vertices: expected a whole number, found 'hello'"},
         {"comments only", "# a\n# b\n", "line 3: expected the word OFF, found the end of the file"},
         {"no counts", "OFF\n",
          "line 2: expected the counts of vertices and faces, found the end of the file"},
         {"one count", "OFF 3\n", "line 1: count of faces is missing"},
         {"negative count", "OFF -3 0 0\n", "line 1: count of vertices: expected a count, found -3"},
         {"binary", "OFF BINARY\n", "line 1: binary OFF files are not read"},
         {"four dimensions", "4OFF\n1 0 0\n0 0 0 1\n", "line 1: '4OFF': only points in space are read"},
         {"10^12 vertices", "OFF\n1000000000000 0 0\n0 0 0\n",
          "line 2: 1000000000000 vertices and 0 faces need 6 and 8 bytes each at least, found 7 bytes in "
          "all"},
         {"short vertex", "OFF\n1 0 0\n0 0     \n", "line 3: z is missing"},
         {"short colour", "COFF\n1 0 0\n0 0 0 1 1   \n", "line 3: blue is missing"},
         {"short normal", "NOFF\n1 0 0\n0 0 0 0 1   \n", "line 3: z of the normal is missing"},
         {"vertices missing", "OFF\n2 0 0\n0 0 0\n        \n",
          "line 5: the file ends where vertex 2 of 2 is expected"},
         {"faces missing", points + "          \n", "line 7: the file ends where face 1 of 1 is expected"},
         {"negative corner", points + "3 0 -1 2\n", "line 6: a corner names vertex -1, expected 0 to 2"},
         {"past the end", points + "3 0 1 3\n", "line 6: a corner names vertex 3, expected 0 to 2"},
         {"two corners", points + "2 0 1      \n",
          "line 6: expected a face of 3 or more corners that the line holds, found 2"},
         {"huge face", points + "999999999 0 1 2\n",
          "line 6: expected a face of 3 or more corners that the line holds, found 999999999"},
         {"corners missing", points + "4 0 1 2\n", "line 6: corner is missing"},
         {"more lines", points + "3 0 1 2\n3 0 1 2\n", "line 7: expected the end of the file, found '3'"},
         {"NaN", "OFF\n1 0 0\n0 0 inf\n", "vertex 0 has a coordinate that is not a finite number"}},
        "m.off");
}

TEST(MeshDamage, Stl) {
    const std::string facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n";
    std::string binary(84 + 50, '\0');
    binary[80] = 1;
    std::string nan = binary;
    nan.replace(84 + 12 + 12 + 4, 4, "\xFF\xFF\xFF\x7F");
    std::string solid = binary;
    solid.replace(0, 5, "solid");
    expect_refused(
        {{"short", "hello", "no STL file: expected the word solid or 84 bytes at least, found 5 bytes"},
         {"cut", binary.substr(0, 133), "byte 80: 1 facets take 134 bytes, found 133"},
         {"cut, called solid", solid.substr(0, 133), "byte 80: 1 facets take 134 bytes, found 133"},
         {"longer", binary + "x", "byte 80: 1 facets take 134 bytes, found 135"},
         {"count", std::string(80, ' ') + "\xFF\xFF\xFF\xFF",
          "byte 80: 4294967295 facets take 214748364834 bytes, found 84"},
         {"NaN", nan, "facet 0: vertex 1 has a coordinate that is not a finite number"},
         {"no endsolid", "solid a\n" + facet + "vertex 0 1 0\nendloop\nendfacet\n",
          "line 9: the file ends before endsolid"},
         {"cut facet", "solid a\n" + facet + "endloop\nendfacet\nendsolid\n",
          "line 7: expected a facet of 3 vertices, found 2"},
         {"four vertices", "solid a\n" + facet + "vertex 0 1 0\nvertex 1 1 0\n",
          "line 7: a vertex that is none of a facet's three"},
         {"stray vertex", "solid a\nvertex 0 0 0\n", "line 2: a vertex that is none of a facet's three"},
         {"nested", "solid a\n" + facet + "facet\n", "line 6: a facet outside a solid or within a facet"},
         {"early end", "solid a\n" + facet + "endsolid\n", "line 6: 'endsolid' out of place"},
         {"word", "solid a\nfacte normal 0 0 1\n",
          "line 2: expected a statement of an STL file, found 'facte'"},
         {"number", "solid a\nfacet\nvertex 0 0 O\n", "line 3: coordinate: expected a number, found 'O'"}},
        "m.stl");
}

TEST(MeshDamage, StlHoldsOnlySoManyFacets) {
    EXPECT_NO_THROW(mesh_formats::check_stl_facets(0xFFFFFFFF, "m.stl"));
    try {
        mesh_formats::check_stl_facets(0x100000000, "m.stl");
        FAIL();
    } catch (const InvalidInput& error) {
        EXPECT_STREQ(error.what(), "m.stl: 4294967296 triangles, an STL file holds 2^32-1 at most");
    }
}

TEST(MeshDamage, BadMeshesAreNotWritten) {
    const TempFolder folder;
    const auto expect_not_written = [&](const TriMesh& mesh, const std::string& name) {
        write_bytes(folder / name, "old");
        EXPECT_THROW(write_mesh(mesh, folder / name), InvalidInput) << name;
        EXPECT_EQ(read_bytes(folder / name), "old");
    };
    for (const std::string& ending : mesh_endings()) {
        TriMesh mesh = tetrahedron();
        mesh.points[1][2] = std::numeric_limits<float>::quiet_NaN();
        expect_not_written(mesh, "m" + ending);
        mesh = tetrahedron();
        mesh.triangles[3][0] = 4;
        expect_not_written(mesh, "m" + ending);
        mesh = tetrahedron();
        mesh.vertex_properties[0].values.pop_back();
        expect_not_written(mesh, "m" + ending);
    }
    for (const char* name : {"", "a b", "a\n", "x", "K", "\xC3\xA4"}) {
        TriMesh mesh = tetrahedron();
        mesh.vertex_properties.push_back({name, 1, {0, 0, 0, 0}});
        expect_not_written(mesh, "m.ply");
        if (name != std::string("a b") && name != std::string("x"))
            for (const char* other : {"m.vtp", "m.vtu", "m.glb"}) expect_not_written(mesh, other);
    }
    TriMesh mesh = tetrahedron();
    mesh.face_properties.push_back({"vertex_indices", 1, {0, 0, 0, 0}});
    expect_not_written(mesh, "m.ply");
}

/// Cuts and flips bits of a good file: each time it either loads or is refused as bad input.
TEST(MeshDamage, RandomDamageLoadsOrIsRefused) {
    const TempFolder folder;
    std::map<std::string, std::string> files;
    for (const std::string& ending : mesh_endings()) {
        write_mesh(tetrahedron(), folder / ("good" + ending));
        files["binary or text" + ending] = read_bytes(folder / ("good" + ending));
    }
    files["ascii.ply"] = ascii_faces("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    files["ascii.stl"] =
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
        "0\nendloop\nendfacet\n"
        "endsolid a\n";
    for (const auto& [name, good] : files) {
        std::mt19937 random(1234);
        int loaded = 0, refused = 0;
        for (int i = 0; i < 1000; ++i) {
            std::string bad = good;
            if (i % 2 == 0) bad.resize(1 + random() % (good.size() - 1));
            for (std::size_t flips = i % 2 == 0 ? i % 4 / 2 : 1 + random() % 4; flips > 0; --flips)
                bad[random() % bad.size()] ^= static_cast<char>(1 << random() % 8);
            std::filesystem::remove(folder / name);  // overwriting waits for the disk
            write_bytes(folder / name, bad);
            try {
                const TriMesh mesh = read_mesh(folder / name);
                EXPECT_NO_THROW(check(mesh, "read"));
                ++loaded;
            } catch (const InvalidInput&) {
                ++refused;
            }
        }
        EXPECT_GT(loaded, 0) << name;
        EXPECT_GT(refused, 200) << name;
    }
}
