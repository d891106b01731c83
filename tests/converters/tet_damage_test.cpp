// Damaged files of tetrahedra are refused with one line that names the place, before memory is taken.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <map>
#include <random>

#include "tests/converters/tet_samples.h"
#include "tests/support/run.h"

using namespace vdbgeo;
using test::read_bytes;
using test::TempFolder;
using test::tet_refusal;
using test::write_bytes;

namespace {

struct Damage {
    const char* defect;
    std::string content;
    const char* message;
};

void expect_refused(const std::vector<Damage>& cases, const std::string& name) {
    for (const Damage& damage : cases)
        EXPECT_EQ(tet_refusal(damage.content, name), damage.message) << damage.defect;
}

/// Values as the bytes of a binary file.
template <class... Values>
std::string packed(Values... values) {
    std::string out;
    (out.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
    return out;
}
std::uint64_t size(std::uint64_t n) { return n; }

const std::string points =
    "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";

}  // namespace

TEST(TetDamage, AnyFormat) {
    for (const char* name : {"m.mesh", "m.msh", "m.node", "m.vtu"}) {
        EXPECT_NE(tet_refusal("", name), "(not refused)") << name;
        EXPECT_NE(tet_refusal("hello\n", name), "(not refused)") << name;
        EXPECT_NE(tet_refusal(std::string(5000, '\0'), name), "(not refused)") << name;
        EXPECT_NE(tet_refusal(std::string(5000, '\xFF'), name), "(not refused)") << name;
    }
}

TEST(TetDamage, Medit) {
    const std::string tets = points + "Tetrahedra\n1\n";
    expect_refused(
        {{"keyword", "MeshVersion 2\n",
          "line 1: no file of Medit: expected MeshVersionFormatted, found 'MeshVersion'"},
         {"version", "MeshVersionFormatted 9\n", "line 1: expected a version of 1 to 4, found 9"},
         {"plane", "MeshVersionFormatted 1\nDimension 2\n", "line 2: 2 dimensions, expected 3"},
         {"cut behind the vertices", points, "line 9: the file ends without the word End"},
         {"no vertices", "MeshVersionFormatted 1\nDimension 3\nEnd\n", "line 3: no section Vertices"},
         {"10^9 vertices", "MeshVersionFormatted 1\nVertices\n1000000000\n0 0 0 0\n",
          "line 3: Vertices: 1000000000 entries need 8 bytes each at least, found 9 bytes in all"},
         {"10^18 tetrahedra", points + "Tetrahedra 1000000000000000000\n1 2 3 4 1\n",
          "line 9: Tetrahedra: 1000000000000000000 entries need 10 bytes each at least, found 11 bytes in "
          "all"},
         {"negative count", points + "Tetrahedra\n-1\n", "line 10: Tetrahedra: expected a count, found -1"},
         {"beyond 64 bits", points + "Edges\n99999999999999999999\n",
          "line 10: count: expected a whole number, found '99999999999999999999'"},
         {"too many vertices", points + "7 7 7 7\n", "line 9: expected a keyword, found '7'"},
         {"too few", "MeshVersionFormatted 2\nVertices\n2\n0 0 0 0\nTetrahedra\n0\n",
          "line 5: coordinate: expected a number, found 'Tetrahedra'"},
         {"vertex 0", tets + "0 1 2 3 1\n", "line 11: a tetrahedron names vertex 0, expected 1 to 4"},
         {"past the end", tets + "1 2 3 5 1\n", "line 11: a tetrahedron names vertex 5, expected 1 to 4"},
         {"past the end of what follows",
          "MeshVersionFormatted 2\nTetrahedra 1\n1 2 3 9 1\nVertices 1\n0 0 0 0\nEnd\n",
          "line 6: a tetrahedron names vertex 2 of 1"},
         {"cut", tets + "1 2 3 4",
          "line 10: Tetrahedra: 1 entries need 10 bytes each at least, found 8 bytes in all"},
         {"cut after a number", points + "Tetrahedra\n1\n1 2 3 4 1",
          "line 11: the file ends without the word End"},
         {"fraction", tets + "1 2 3 4.5 1\n", "line 11: corner: expected a whole number, found '4.5'"},
         {"NaN", "MeshVersionFormatted 2\nVertices\n1\n0 nan 0 0\nEnd\n",
          "vertex 0 has a coordinate that is not a finite number"},
         {"infinity", "MeshVersionFormatted 2\nVertices\n1\n0 1e999 0 0\nEnd\n",
          "vertex 0 has a coordinate that is not a finite number"},
         {"twice", points + "Vertices\n0\n", "line 9: a second section Vertices"},
         {"hexahedra", points + "Hexahedra\n1\n1 2 3 4 1 2 3 4 0\n",
          "line 10: Hexahedra: only tetrahedra are read"},
         {"a surface", points + "Triangles\n1\n1 2 3 0\nEnd\n", "a surface of 1 faces, no tetrahedra"},
         {"a section cut short", points + "Triangles\n2\n1 2 3 0\nEnd    \n",
          "line 12: Triangles: 1 entries of 2"},
         {"a vertex twice", tets + "1 2 3 3 1\n", "tetrahedron 0 names vertex 2 twice"},
         {"the same tetrahedron twice", points + "Tetrahedra\n2\n1 2 3 4 1\n1 2 3 4 1\n",
          "the triangle of vertices 0, 1, 2 has two tetrahedra on the same side"}},
        "m.mesh");
}

TEST(TetDamage, GmshText) {
    const std::string two = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
                      nodes = two + "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n",
                      four = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n",
                      nodes4 =
                          four +
                          "$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n";
    expect_refused(
        {{"no Gmsh", "$Nodes\n", "line 1: no file of Gmsh: expected $MeshFormat, found '$Nodes'"},
         {"old", "$MeshFormat\n1 0 8\n", "line 2: files of version 1 are not read: expected 2 or 4.1"},
         {"4.0", "$MeshFormat\n4 0 8\n", "line 2: files of version 4 are not read: expected 2 or 4.1"},
         {"NaN", "$MeshFormat\nnan 0 8\n", "line 2: files of version nan are not read: expected 2 or 4.1"},
         {"type", "$MeshFormat\n2.2 7 8\n", "line 2: type of the file: expected 0 or 1, found 7"},
         {"size", "$MeshFormat\n4.1 0 3\n", "line 2: data size: expected 8 or 4, found 3"},
         {"header alone", two, "line 4: no section $Nodes"},
         {"no elements", nodes, "line 11: no section $Elements"},
         {"order", two + "$Elements\n0\n$EndElements\n", "line 4: $Elements before $Nodes"},
         {"twice", nodes + "$Nodes\n0\n$EndNodes\n", "line 11: a second section $Nodes"},
         {"no section", two + "Nodes\n", "line 4: expected a section such as $Nodes, found 'Nodes'"},
         {"unfinished", nodes + "$NodeData\n1\n", "line 13: the file ends before '$EndNodeData'"},
         {"10^9 nodes", two + "$Nodes\n1000000000\n1 0 0 0\n",
          "line 5: nodes: 1000000000 entries of 4 numbers, found 10 bytes"},
         {"negative", two + "$Nodes\n-5\n", "line 5: count of nodes: expected a count, found -5"},
         {"node 0", two + "$Nodes\n1\n0 0 0 0\n$EndNodes\n", "line 6: node 0: expected 1 or more"},
         {"node twice", two + "$Nodes\n2\n3 0 0 0\n3 0 0 0\n$EndNodes\n", "line 7: node 3 is there twice"},
         {"more nodes", two + "$Nodes\n1\n1 0 0 0\n2 0 0 0\n$EndNodes\n",
          "line 7: expected $EndNodes, found '2'"},
         {"fewer nodes", two + "$Nodes\n2\n1 0 0 0\n$EndNodes\n",
          "line 7: tag of a node: expected a whole number, found '$EndNodes'"},
         {"no such node", nodes + "$Elements\n1\n1 4 0 1 2 3 5\n$EndElements\n",
          "line 13: an element names node 5, which is not there"},
         {"huge node", nodes + "$Elements\n1\n1 4 0 1 2 3 2147483647\n$EndElements\n",
          "line 13: an element names node 2147483647, which is not there"},
         {"hexahedron", nodes + "$Elements\n1\n1 5 0 1 2 3 4 1 2 3 4\n$EndElements\n",
          "line 13: a hexahedron: only tetrahedra are read"},
         {"type", nodes + "$Elements\n1\n1 99 0 1 2 3 4\n$EndElements\n",
          "line 13: elements of type 99 are not known"},
         {"tags", nodes + "$Elements\n1\n1 4 -1 1 2 3 4\n$EndElements\n",
          "line 13: 1 of 1 elements, -1 tags"},
         {"many tags", nodes + "$Elements\n1\n1 4 2147483647 1 2 3 4\n$EndElements\n",
          "line 13: elements: 1 entries of 2147483651 numbers, found 23 bytes"},
         {"cut", nodes + "$Elements\n2\n1 4 0 1 2 3 4\n", "line 14: number of an element: the file ends"},
         {"10^9 elements", nodes + "$Elements\n1000000000\n1 4 0 1 2 3 4\n",
          "line 12: elements: 1000000000 entries of 3 numbers, found 16 bytes"},
         {"four: counts", four + "$Nodes\n1 2 1 4\n3 1 0 3\n1 2 3\n0 0 0 0 0 0\n",
          "line 6: more than the 2 nodes that are announced"},
         {"four: fewer", four + "$Nodes\n1 2 1 4\n3 1 0 1\n1\n0 0 0\n$EndNodes\n",
          "line 8: 1 nodes, 2 are announced"},
         {"four: 10^18", four + "$Nodes\n1 1000000000000000000 1 4\n",
          "line 5: nodes: 1000000000000000000 entries of 4 numbers, found 2 bytes"},
         {"four: dimension", four + "$Nodes\n1 1 1 4\n4 1 1 1\n1\n0 0 0\n$EndNodes\n",
          "line 6: an entity of dimension 4"},
         {"four: blocks", four + "$Nodes\n1000000000000 0 1 4\n", "line 6: dimension: the file ends"},
         {"four: 10^9 elements", nodes4 + "$Elements\n1 1000000000 1 1\n3 1 4 1000000000\n1 1 2 3 4\n",
          "line 18: elements: 1000000000 entries of 5 numbers, found 12 bytes"},
         {"four: elements that are passed over",
          nodes4 + "$Elements\n1 9000000000000000000 1 1\n2 1 25 "
                   "9000000000000000000\n1 1 2 3 4\n",
          "line 18: elements: 9000000000000000000 entries of 22 numbers, found 12 bytes"},
         {"four: entities", four + "$Entities\n0 0 0 1\n1 0 0 0 1 1 1 4000000000 1\n",
          "line 6: physical groups: 3999999999 entries of 1 numbers, found 2 bytes"},
         {"four: 32 bits", four + "$Entities\n0 0 0 1\n4294967297 0 0 0 1 1 1 0 0\n",
          "line 6: entity: 4294967297 has more than 32 bits"}},
        "m.msh");
}

TEST(TetDamage, GmshBinary) {
    const std::string head = "$MeshFormat\n4.1 1 8\n" + packed(1) + "\n$EndMeshFormat\n",
                      nodes =
                          head + "$Nodes\n" +
                          packed(size(1), size(1), size(1), size(1), 3, 1, 0, size(1), size(1), 0., 0., 0.) +
                          "\n$EndNodes\n";
    expect_refused(
        {{"no number 1", "$MeshFormat\n4.1 1 8\n" + packed(2) + "\n",
          "byte 24: expected the number 1 in 4 bytes"},
         {"cut", "$MeshFormat\n4.1 1 8\n\1", "byte 20: the number 1: the file ends"},
         {"cut at once", "$MeshFormat\n4.1 1 8", "byte 19: the number 1: the file ends"},
         {"10^9 nodes", head + "$Nodes\n" + packed(size(1), size(1000000000), size(1), size(1)),
          "byte 79: nodes: 1000000000 entries of 4 numbers, found 0 bytes"},
         {"2^64-1 nodes", head + "$Nodes\n" + packed(size(1), ~size(0), size(1), size(1)),
          "byte 79: nodes: 18446744073709551615 entries of 4 numbers, found 0 bytes"},
         {"no elements", nodes, "byte 142: no section $Elements"},
         {"2^63 elements",
          nodes + "$Elements\n" + packed(size(1), size(1) << 63, size(1), size(1), 3, 1, 4, size(1) << 63),
          "byte 204: elements: 9223372036854775808 entries of 5 numbers, found 0 bytes"},
         {"end", head + "$Nodes\n" + packed(size(0), size(0), size(1), size(1)) + "\n$EndElements\n",
          "byte 93: expected $EndNodes, found '$EndElements'"}},
        "m.msh");
    const std::string old = "$MeshFormat\n2.2 1 8\n" + packed(1) + "\n$EndMeshFormat\n$Nodes\n1\n" +
                            packed(1, 0., 0., 0.) + "\n$EndNodes\n$Elements\n";
    expect_refused(
        {{"follow", old + "5\n" + packed(4, 7, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1),
          "byte 112: 7 of 5 elements, 0 tags"},
         {"negative", old + "1\n" + packed(4, -1, 0, 1, 1, 1, 1), "byte 112: -1 of 1 elements, 0 tags"},
         {"cut", old + "1\n" + packed(4, 1, 0, 1, 1),
          "byte 112: elements: 1 entries of 4 numbers, found 8 bytes"}},
        "m.msh");
}

TEST(TetDamage, Tetgen) {
    const TempFolder folder;
    const auto refusal = [&](const std::string& node, const std::string& ele) {
        write_bytes(folder / "m.node", node);
        write_bytes(folder / "m.ele", ele);
        try {
            read_tets(folder / "m.ele");
        } catch (const InvalidInput& error) {
            const std::string text = error.what();
            return text.substr(folder.path().string().size() + 1);
        }
        return std::string("(not refused)");
    };
    const std::string node = "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";
    EXPECT_EQ(refusal("1000000000 3 0 0\n1 0 0 0\n", ""),
              "m.node: line 1: 1000000000 entries of 4 numbers, found 13 bytes");
    EXPECT_EQ(refusal("-1 3 0 0\n", ""), "m.node: line 1: count of points: expected a count, found -1");
    EXPECT_EQ(refusal("1 2 0 0\n1 0 0\n", ""), "m.node: line 1: 2 dimensions, expected 3");
    EXPECT_EQ(refusal("1 3 0 0\n2 0 0 0\n", ""), "m.node: line 2: the first number is 2, expected 0 or 1");
    EXPECT_EQ(refusal("2 3 0 0\n0 0 0 0\n2 0 0 0\n", ""), "m.node: line 3: entry 1 is numbered 2");
    EXPECT_EQ(refusal("2 3 0 0\n0 0 0 0\n        \n", ""),
              "m.node: line 4: the file ends where entry 2 of 2 is expected");
    EXPECT_EQ(refusal("1 3 0 0\n0 0 0   \n", ""), "m.node: line 2: coordinate is missing");
    EXPECT_EQ(refusal("1 3 0 0\n0 0 0 0\n1 0 0 0\n", ""),
              "m.node: line 3: expected the end of the file, found '1'");
    EXPECT_EQ(refusal(node, "# nothing\n"), "m.ele: line 2: the file is empty");
    EXPECT_EQ(refusal(node, "1 5 0\n"), "m.ele: line 1: expected tetrahedra of 4 or 10 nodes, found 5");
    EXPECT_EQ(refusal(node, "1000000000000000000 4 0\n1 1 2 3 4\n"),
              "m.ele: line 1: 1000000000000000000 entries of 5 numbers, found 11 bytes");
    EXPECT_EQ(refusal(node, "1 4 0\n1 1 2 3 5\n"),
              "m.ele: line 2: a tetrahedron names point 5; there are 4, counted from 1");
    EXPECT_EQ(refusal(node, "1 4 0\n1 0 1 2 3\n"),
              "m.ele: line 2: a tetrahedron names point 0; there are 4, counted from 1");
    EXPECT_EQ(refusal(node, "1 4 0\n0 1 2 3 4\n"), "m.ele: line 2: entry 1 is numbered 0");
    EXPECT_EQ(refusal(node, "1 4 1\n1 1 2 3 4   \n"), "m.ele: line 2: attribute is missing");
    EXPECT_EQ(refusal(node, "1 4 1\n1 1 2 3 4 nan\n"), "m.ele: tetrahedron 0: its region is not a number");
}

TEST(TetDamage, Vtu) {
    const auto grid = [](const std::string& counts, const std::string& corners, const std::string& ends,
                         const std::string& types) {
        const std::string array = "<DataArray type=\"Int64\" format=\"ascii\" Name=";
        return "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece " + counts +
               "><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 "
               "1 0 "
               "0 0 1</DataArray></Points><Cells>" +
               array + "\"connectivity\">" + corners + "</DataArray>" + array + "\"offsets\">" + ends +
               "</DataArray>" + array + "\"types\">" + types +
               "</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>";
    };
    const std::string one = "NumberOfPoints=\"4\" NumberOfCells=\"1\"";
    expect_refused(
        {{"10^9 points", grid("NumberOfPoints=\"1000000000\" NumberOfCells=\"1\"", "0 1 2 3", "4", "10"),
          "array '': expected 3000000000 values, found 12"},
         {"10^9 cells", grid("NumberOfPoints=\"4\" NumberOfCells=\"1000000000\"", "0 1 2 3", "4", "10"),
          "array 'offsets': expected 1000000000 values, found 1"},
         {"corners", grid(one, "0 1 2", "3", "10"), "cell 0 is a tetrahedron of 3 corners"},
         {"past the end", grid(one, "0 1 2 4", "4", "10"), "Cells: cell 0 names point 4 of 4"},
         {"ends", grid(one, "0 1 2 3", "5", "10"), "Cells: cell 0 ends at corner 5 of 4"},
         {"hexahedron", grid(one, "0 1 2 3 0 1 2 3", "8", "12"),
          "cell 0 is a hexahedron: only tetrahedra are read"},
         {"unknown", grid(one, "0 1 2 3", "4", "-9"), "cell 0 is of type -9: only tetrahedra are read"},
         {"surface", grid(one, "0 1 2", "3", "5"), "a surface of 1 faces, no tetrahedra"},
         {"PolyData", "<VTKFile type=\"PolyData\"><Piece NumberOfPoints=\"0\"></Piece></VTKFile>",
          "PolyData, which has no tetrahedra: expected an UnstructuredGrid"}},
        "m.vtu");
}

/// Cuts and flips bits of good files: each time they load or are refused as bad input, within little memory.
TEST(TetDamage, RandomDamageLoadsOrIsRefused) {
    const TempFolder folder;
    const TetMesh mesh = test::two_regions(1);
    std::map<std::string, std::string> files;
    for (const std::string& ending : tet_endings()) {
        write_tets(mesh, folder / ("good" + ending));
        files[ending] = read_bytes(folder / ("good" + ending));
    }
    files["old text.msh"] =
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
        "$Elements\n2\n1 2 2 0 1 1 2 3\n2 4 2 1 1 1 2 3 4\n$EndElements\n";
    files["text.msh"] =
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 1 5 0\n$EndEntities\n"
        "$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n"
        "$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
    files["old.msh"] = "$MeshFormat\n2.2 1 8\n" + packed(1) + "\n$EndMeshFormat\n$Nodes\n4\n" +
                       packed(1, 0., 0., 0.) + packed(2, 1., 0., 0.) + packed(3, 0., 1., 0.) +
                       packed(4, 0., 0., 1.) + "\n$EndNodes\n$Elements\n1\n" +
                       packed(4, 1, 2, 1, 5, 1, 1, 2, 3, 4) + "\n$EndElements\n";
    struct rusage before {
    }, after{};
    ::getrusage(RUSAGE_SELF, &before);
    for (const auto& [name, good] : files) {
        std::mt19937 random(1234);
        int refused = 0;
        const auto path = folder / ("bad" + name);
        for (int i = 0; i < 1000; ++i) {
            std::string bad = good;
            if (i % 2 == 0) bad.resize(random() % good.size());
            for (std::size_t flips = i % 2 == 0 ? i % 4 / 2 : 1 + random() % 4; flips > 0 && !bad.empty();
                 --flips)
                bad[random() % bad.size()] ^= static_cast<char>(1 << random() % 8);
            for (const char* other : {".node", ".ele"})  // the one that is not damaged is there too
                if (name == ".node" || name == ".ele") {
                    std::filesystem::remove(folder / (std::string("bad") + other));
                    write_bytes(folder / (std::string("bad") + other), files[other]);
                }
            std::filesystem::remove(path);  // overwriting waits for the disk
            write_bytes(path, bad);
            try {
                const TetMesh read = read_tets(path);
                EXPECT_NO_THROW(check(read, "read"));
            } catch (const InvalidInput&) {
                ++refused;
            }
        }
        EXPECT_GT(refused, 200) << name;
    }
    ::getrusage(RUSAGE_SELF, &after);
    if (!test::sanitized) {
        EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 50 * 1024);
    }
}

/// A file that is cut anywhere is refused, or nothing of the mesh was in what is missing.
TEST(TetDamage, CutAnywhere) {
    const TempFolder folder;
    const TetMesh mesh = test::two_regions(1);
    for (const char* name : {"m.vtu", "m.mesh", "m.msh"}) {
        write_tets(mesh, folder / name);
        const std::string good = read_bytes(folder / name);
        for (std::size_t length = 0; length < good.size(); ++length) {
            const auto path = folder / (std::string("cut_") + name);
            std::filesystem::remove(path);
            write_bytes(path, good.substr(0, length));
            try {
                test::expect_same(read_tets(path), mesh);
            } catch (const InvalidInput&) {
            }
        }
    }
}
