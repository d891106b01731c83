// Files of tetrahedra: there and back, and files as other programs write them.
#include <gtest/gtest.h>

#include <limits>

#include "converters/mesh_file.h"
#include "tests/converters/tet_samples.h"
#include "vdbgeo/core/atomic_file.h"

using namespace vdbgeo;
using test::expect_same;
using test::read_bytes;
using test::TempFolder;
using test::tet_refusal;
using test::tets_in;
using test::two_regions;
using test::write_bytes;

namespace {

/// A unit corner in five lines of each text format; the second tetrahedron lies below it.
const std::string medit =
    "MeshVersionFormatted 2\nDimension 3\nVertices\n5\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 -1 0\n"
    "Tetrahedra\n2\n1 2 3 4 5\n1 3 2 5 9\n";

void expect_two(const TetMesh& mesh, const std::vector<std::int32_t>& regions) {
    ASSERT_EQ(mesh.points.size(), 5u);
    EXPECT_EQ(mesh.points[4], Vec3d(0, 0, -1));
    ASSERT_EQ(mesh.tets, (Array<Tetrahedron>{{0, 1, 2, 3}, {0, 2, 1, 4}}));
    for (std::size_t t = 0; t < 2; ++t) EXPECT_EQ(mesh.region(t), regions[t]);
    EXPECT_EQ(mesh.faces.size(), regions[0] == regions[1] ? 6u : 7u);
}

}  // namespace

TEST(TetFile, EachFormatGivesTheMeshBack) {
    const TempFolder folder;
    const TetMesh mesh = two_regions();
    ASSERT_EQ(mesh.tets.size(), 6u * 27);
    for (const std::string& ending : tet_endings()) {
        SCOPED_TRACE(ending);
        const auto path = folder / ("m" + ending);
        write_tets(mesh, path);
        EXPECT_TRUE(is_tet_ending(path));
        EXPECT_TRUE(holds_tets(path));
        const TetMesh back = read_tets(path);
        expect_same(back, mesh);
        EXPECT_TRUE(back.vertex_properties.empty());
        EXPECT_TRUE(back.tet_properties.empty());
        const auto again = folder / ("again" + ending);
        write_tets(back, again);
        EXPECT_EQ(read_bytes(path), read_bytes(again));
    }
    EXPECT_EQ(read_bytes(folder / "m.face"), read_bytes(folder / "again.face"));
}

TEST(TetFile, HardMeshesComeBackToo) {
    const TempFolder folder;
    std::vector<std::pair<std::string, TetMesh>> meshes;
    meshes.emplace_back("nothing", TetMesh());
    TetMesh mesh;
    mesh.points.assign(3, Vec3d(1, 2, 3));
    meshes.emplace_back("points alone", mesh);
    meshes.emplace_back("one region", test::cell_tets(2, [](int, int, int) { return 1; }));
    mesh = test::cell_tets(1, [](int, int, int) { return std::numeric_limits<std::int32_t>::max(); });
    const double least = std::numeric_limits<double>::denorm_min(),
                 most = std::numeric_limits<double>::max() / 4;
    mesh.points.emplace_back(least, -least, most);
    mesh.points.emplace_back(1.0 / 3, std::nextafter(1.0, 2), -most);
    meshes.emplace_back("numbers at the ends of their ranges", mesh);
    meshes.emplace_back("pieces that touch nowhere", test::cell_tets(3, [](int x, int y, int z) {
                            return (x + y + z) % 2 == 0 ? 0 : 1 + x * y * z;
                        }));
    // A tetrahedron cut into four about its middle, and itself turned over: no face is left over.
    TetMesh closed;
    closed.points = {Vec3d(0, 0, 0), Vec3d(4, 0, 0), Vec3d(0, 4, 0), Vec3d(0, 0, 4), Vec3d(1, 1, 1)};
    closed.tets = {{4, 1, 2, 3}, {0, 4, 2, 3}, {0, 1, 4, 3}, {0, 1, 2, 4}, {1, 0, 2, 3}};
    set_faces(closed);
    ASSERT_TRUE(closed.faces.empty());
    meshes.emplace_back("without a boundary", closed);
    for (const auto& [name, each] : meshes)
        for (const std::string& ending : tet_endings()) {
            SCOPED_TRACE(name + " " + ending);
            write_tets(each, folder / ("m" + ending));
            expect_same(read_tets(folder / ("m" + ending)), each);
        }
}

TEST(TetFile, EndingsInAnyCaseAndOthersRefused) {
    const TempFolder folder;
    const TetMesh mesh = two_regions(2);
    for (const char* name : {"M.VTU", "M.Mesh", "M.MSH", "M.NODE"}) {
        write_tets(mesh, folder / name);
        expect_same(read_tets(folder / name), mesh);
    }
    EXPECT_TRUE(std::filesystem::exists(folder / "M.ELE"));
    EXPECT_FALSE(is_tet_ending("m.meshb"));
    EXPECT_FALSE(holds_tets("m.ply"));
    EXPECT_EQ(tet_endings_text(), ".vtu .mesh .msh .node .ele");
    for (const char* name : {"m.ply", "m", "m.face"}) {
        EXPECT_THROW(write_tets(mesh, folder / name), InvalidInput);
        EXPECT_FALSE(std::filesystem::exists(folder / name));
        EXPECT_THROW(read_tets(folder / name), InvalidInput);
    }
    EXPECT_THROW(read_tets(folder / "none.msh"), IoError);
    EXPECT_THROW(holds_tets(folder / "none.vtu"), IoError);
}

TEST(TetFile, PropertiesSurviveInVtu) {
    const TempFolder folder;
    TetMesh mesh = two_regions(2);
    MeshProperty x{"x", 1, {}}, vector{"a vector", 3, {}}, volume{"volume", 1, {}};
    for (std::size_t v = 0; v < mesh.points.size(); ++v) x.values.push_back(static_cast<float>(v) * 0.1f);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        volume.values.push_back(static_cast<float>(tet_determinant(mesh, t)));
        vector.values.insert(vector.values.end(), {float(t), -1, 2});
    }
    mesh.vertex_properties = {x};
    mesh.tet_properties = {volume, vector};
    write_tets(mesh, folder / "m.vtu");
    const TetMesh back = read_tets(folder / "m.vtu");
    expect_same(back, mesh);
    ASSERT_EQ(back.vertex_properties.size(), 1u);
    EXPECT_EQ(back.find_vertex_property("x")->values, x.values);
    ASSERT_EQ(back.tet_properties.size(), 2u);
    EXPECT_EQ(back.find_tet_property("volume")->values, volume.values);
    EXPECT_EQ(back.find_tet_property("a vector")->components, 3);
    EXPECT_EQ(back.find_tet_property("a vector")->values, vector.values);
    write_tets(mesh, folder / "m.msh");
    EXPECT_TRUE(read_tets(folder / "m.msh").tet_properties.empty());
    mesh.tet_properties[0].name = "region";
    EXPECT_THROW(write_tets(mesh, folder / "n.vtu"), InvalidInput);
    EXPECT_FALSE(std::filesystem::exists(folder / "n.vtu"));
}

TEST(TetFile, FacesAreFoundWhereNobodyAskedForThem) {
    const TempFolder folder;
    const TetMesh mesh = two_regions(2);
    TetMesh bare = mesh;
    bare.faces.clear();
    bare.face_regions.clear();
    for (const std::string& ending : tet_endings()) {
        write_tets(bare, folder / ("bare" + ending));
        write_tets(mesh, folder / ("m" + ending));
        EXPECT_EQ(read_bytes(folder / ("bare" + ending)), read_bytes(folder / ("m" + ending)));
    }
}

TEST(TetFile, NothingIsHalfWritten) {
    const TempFolder folder;
    TetMesh bad = two_regions(2);
    bad.points[3][1] = std::numeric_limits<double>::quiet_NaN();
    for (const std::string& ending : tet_endings()) {
        write_bytes(folder / ("m" + ending), "old");
        EXPECT_THROW(write_tets(bad, folder / ("m" + ending)), InvalidInput);
        EXPECT_EQ(read_bytes(folder / ("m" + ending)), "old");
    }
    // three files or none
    const TetMesh good = two_regions(2);
    std::filesystem::create_directory(folder / "m.face");
    EXPECT_THROW(write_tets(good, folder / "m.ele"), IoError);
    EXPECT_EQ(read_bytes(folder / "m.node"), "old");
    EXPECT_EQ(read_bytes(folder / "m.ele"), "old");
    EXPECT_THROW(write_tets(good, folder / "no/such/folder.msh"), IoError);
    const Progress stop([](double) { return false; });
    for (const char* name : {"m.vtu", "m.mesh", "m.msh"}) {
        EXPECT_THROW(write_tets(good, folder / name, stop), Cancelled);
        EXPECT_EQ(read_bytes(folder / name), "old");
    }
}

TEST(TetFile, RegionsThatAreNoNumbersFromOneGetFreeOnes) {
    const auto with = [](const std::string& first, const std::string& second) {
        std::string text = medit;
        text.replace(text.find("4 5\n"), 4, "4 " + first + "\n");
        text.replace(text.find("5 9\n"), 4, "5 " + second + "\n");
        return tets_in(text, "m.mesh");
    };
    expect_two(with("5", "9"), {5, 9});
    expect_two(with("0", "9"), {10, 9});
    expect_two(with("0", "0"), {1, 1});
    expect_two(with("0", "-4"), {2, 1});
    expect_two(with("4", "4294967297"), {4, 5});
    EXPECT_TRUE(with("0", "0").regions.empty());
}

TEST(TetFile, AWholeFileTurnedOverIsTurnedBack) {
    std::string text = medit;
    text.replace(text.find("1 2 3 4 5"), 9, "2 1 3 4 5");
    text.replace(text.find("1 3 2 5 9"), 9, "3 1 2 5 9");
    TetMesh mesh = tets_in(text, "m.mesh");
    for (std::size_t t = 0; t < 2; ++t) EXPECT_GT(tet_determinant(mesh, t), 0);
    EXPECT_EQ(mesh.faces.size(), 7u);
    // a single one is left as it is
    const std::string apart =
        "MeshVersionFormatted 2 Dimension 3 Vertices 8 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0 "
        "5 0 0 0 6 0 0 0 5 1 0 0 5 0 1 0 Tetrahedra 2 ";
    mesh = tets_in(apart + "1 2 3 4 1 6 5 7 8 1 End", "m.mesh");
    EXPECT_GT(tet_determinant(mesh, 0), 0);
    EXPECT_LT(tet_determinant(mesh, 1), 0);
    mesh = tets_in(apart + "2 1 3 4 1 6 5 7 8 1 End", "m.mesh");
    for (std::size_t t = 0; t < 2; ++t) EXPECT_GT(tet_determinant(mesh, t), 0);
    // and where two overlap the file is refused
    text = medit;
    text.replace(text.find("1 2 3 4 5"), 9, "2 1 3 4 5");
    EXPECT_EQ(tet_refusal(text, "m.mesh"),
              "the triangle of vertices 0, 1, 2 has two tetrahedra on the same side");
}

TEST(TetFile, MeditAsOthersWriteIt) {
    expect_two(tets_in(medit, "m.mesh"), {5, 9});
    expect_two(tets_in("# by hand\r\nMeshVersionFormatted\r\n1\r\n\r\nDimension\r\n3\r\n"
                       "Vertices 5 0 0 0 1 1 0 0 1\r\n0 1 0 1 0 0 1 1 0 0 -1e0 1 # five\r\n"
                       "Edges 1\r\n1 2 0\r\nCorners\r\n2\r\n1\r\n2\r\nRequiredVertices\r\n1\r\n3\r\n"
                       "Normals\r\n1\r\nnan 0 1\r\nNormalAtVertices\r\n1\r\n1 1\r\nRidges\r\n0\r\n"
                       "SomethingNew\r\n2\r\n1 2 3 4 5.5 6\r\nQuadrilaterals 1 1 2 3 4 0\r\n"
                       "Tetrahedra\r\n2\r\n1 2 3 4 5\r\n1 3 2 5 9\r\nTriangles\r\n1\r\n1 2 3 1\r\nEnd\r\n",
                       "m.mesh"),
               {5, 9});
    // cells before their points
    expect_two(
        tets_in("MeshVersionFormatted 2 Dimension 3 Tetrahedra 2 1 2 3 4 1 1 3 2 5 1 Vertices 5 0 0 0 0 "
                "1 0 0 0 0 1 0 0 0 0 1 0 0 0 -1 0 End",
                "m.mesh"),
        {1, 1});
    const TetMesh quadratic = tets_in(
        "MeshVersionFormatted 2 Dimension 3 Vertices 11 9 9 9 0 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0 "
        ".5 0 0 0 .5 .5 0 0 0 .5 0 0 0 0 .5 0 .5 0 .5 0 0 .5 .5 0 TetrahedraP2 1 2 3 4 5 6 7 8 9 10 11 3 End",
        "m.mesh");
    EXPECT_EQ(quadratic.points.size(), 5u);  // the point that belongs to nothing stays
    EXPECT_EQ(quadratic.tets, (Array<Tetrahedron>{{1, 2, 3, 4}}));
    EXPECT_EQ(quadratic.region(0), 3);
}

TEST(TetFile, GmshAsOthersWriteIt) {
    const std::string version2 =
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Comments\nNodes of any numbers\n$EndComments\n"
        "$Nodes\n6\n900000000 0 0 -1\n7 0 0 0\n9 1 0 0\n10 0 1 0\n500 0 0 1\n3 5 5 5\n$EndNodes\n"
        "$Elements\n4\n1 15 2 0 1 3\n2 2 2 4 1 7 9 10\n20 4 3 5 1 0 7 9 10 500\n"
        "12 4 2 9 2 7 10 9 900000000\n$EndElements\n";
    TetMesh mesh = tets_in(version2, "m.msh");
    ASSERT_EQ(mesh.points.size(), 6u);  // in the order of the tags
    EXPECT_EQ(mesh.points[0], Vec3d(5, 5, 5));
    EXPECT_EQ(mesh.points[5], Vec3d(0, 0, -1));
    EXPECT_EQ(mesh.tets, (Array<Tetrahedron>{{1, 3, 2, 5}, {1, 2, 3, 4}}));
    EXPECT_EQ(mesh.regions, (Array<std::int32_t>{9, 5}));
    std::string groups = version2;
    groups.replace(groups.find("3 5 1 0"), 7, "3 0 6 0");
    groups.replace(groups.find("2 9 2"), 5, "2 0 2");
    EXPECT_EQ(tets_in(groups, "m.msh").regions, (Array<std::int32_t>{2, 6}));  // entities

    const std::string version4 =
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 5 \"the $EndNodes of it\"\n"
        "$EndPhysicalNames\n$Entities\n1 0 1 2\n1 0 0 0 0\n4 0 0 0 1 1 0 1 3 0\n"
        "1 0 0 0 1 1 1 2 -5 8 1 4\n2 0 0 0 1 1 1 0 0\n$EndEntities\n"
        "$Nodes\n3 5 1 900000000\n2 4 1 1\n900000000\n0 0 -1 0.25 0.75\n0 1 0 0\n3 1 0 4\n7\n9\n10\n500\n"
        "0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n"
        "$Elements\n3 3 1 20\n2 4 2 1\n2 7 9 10\n3 1 4 1\n1 7 9 10 500\n3 2 4 1\n12 7 10 9 900000000\n"
        "$EndElements\n";
    mesh = tets_in(version4, "m.msh");
    ASSERT_EQ(mesh.points.size(), 5u);
    EXPECT_EQ(mesh.points[4], Vec3d(0, 0, -1));
    expect_two(mesh, {5, 6});  // without a group: the next free number
    std::string none = version4;
    none.replace(none.find("2 -5 8 1 4"), 10, "0 1 4");
    expect_two(tets_in(none, "m.msh"), {1, 2});
}

TEST(TetFile, TetgenAsOthersWriteIt) {
    const TempFolder folder;
    const auto read = [&](const std::string& node, const std::string& ele) {
        write_bytes(folder / "m.node", node);
        write_bytes(folder / "m.ele", ele);
        return read_tets(folder / "m.node");
    };
    expect_two(read("# points\n\n5  3  2  1\n 0 0 0 0 7.5 8 1\n 1 1 0 0 7 8 1 # more\n 2 0 1 0 7 8 0\n"
                    "3 0 0 1 7 8 -1\n 4 0 0 -1 7 8 1\n# end\n",
                    "2 4 2\n0 0 1 2 3 5 1.5\n1 0 2 1 4 9 2\n"),
               {5, 9});
    expect_two(read("5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 0 0 -1", "2\n1 1 2 3 4\n2 1 3 2 5"), {1, 1});
    expect_two(
        read("5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 0 0 -1", "2 4 1\n1 1 2 3 4 -10.5\n2 1 3 2 5 1e2"),
        {101, 100});
    const TetMesh quadratic = read(
        "10 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n4 0 0 .5\n5 .5 .5 0\n6 0 .5 0\n7 0 .5 .5\n"
        "8 .5 0 .5\n9 .5 0 0\n",
        "1 10 0\n0 0 1 2 3 4 5 6 7 8 9\n");
    EXPECT_EQ(quadratic.points.size(), 4u);
    std::filesystem::remove(folder / "m.ele");
    EXPECT_THROW(read_tets(folder / "m.node"), IoError);
    EXPECT_THROW(read_tets(folder / "m.ele"), IoError);
}

TEST(TetFile, VtuOfTrianglesStaysASurface) {
    const TempFolder folder;
    TriMesh surface;
    surface.points = {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
    surface.triangles = {{0, 1, 2}};
    write_mesh(surface, folder / "s.vtu");
    EXPECT_FALSE(holds_tets(folder / "s.vtu"));
    EXPECT_EQ(read_mesh(folder / "s.vtu").triangles.size(), 1u);
    try {
        read_tets(folder / "s.vtu");
        ADD_FAILURE() << "a surface was read as tetrahedra";
    } catch (const InvalidInput& error) {
        EXPECT_NE(std::string(error.what()).find("a surface of 1 faces, no tetrahedra"), std::string::npos);
    }
    write_tets(two_regions(1), folder / "t.vtu");
    try {
        read_mesh(folder / "t.vtu");
        ADD_FAILURE() << "tetrahedra were read as a surface";
    } catch (const InvalidInput& error) {
        EXPECT_NE(std::string(error.what()).find("cell 0 is a tetrahedron"), std::string::npos)
            << error.what();
    }
    for (const char* name : {"t.msh", "t.mesh", "t.ele"}) {
        write_tets(two_regions(1), folder / name);
        try {
            read_mesh(folder / name);
            ADD_FAILURE() << name;
        } catch (const InvalidInput& error) {
            EXPECT_NE(std::string(error.what()).find("a file of tetrahedra"), std::string::npos);
        }
    }
}

TEST(TetFile, PiecesOfAVtuFileAreJoined) {
    const std::string array = "<DataArray type=\"Int32\" format=\"ascii\" Name=";
    const auto piece = [&](const std::string& region, const std::string& more) {
        return "<Piece NumberOfPoints=\"4\" NumberOfCells=\"2\"><PointData>" + array +
               "\"p\">1 2 3 4</DataArray>" + more + "</PointData><CellData>" + array + "\"region\">" +
               region + "</DataArray>" + array +
               "\"c\">6 7</DataArray></CellData><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" "
               "format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 0.1</DataArray></Points><Cells>" +
               array + "\"connectivity\">0 0 1 2 3</DataArray>" + array + "\"offsets\">1 5</DataArray>" +
               array + "\"types\">1 10</DataArray></Cells></Piece>";
    };
    const TetMesh mesh =
        tets_in("<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>" + piece("0 4", "") +
                    piece("0 2", array + "\"q\">1 2 3 4</DataArray>") + "</UnstructuredGrid></VTKFile>",
                "m.vtu");
    EXPECT_EQ(mesh.points.size(), 8u);
    EXPECT_EQ(mesh.points[7], Vec3d(0, 0, 0.1));
    EXPECT_EQ(mesh.tets, (Array<Tetrahedron>{{0, 1, 2, 3}, {4, 5, 6, 7}}));
    EXPECT_EQ(mesh.regions, (Array<std::int32_t>{4, 2}));
    ASSERT_EQ(mesh.vertex_properties.size(), 1u);
    EXPECT_EQ(mesh.vertex_properties[0].values, (std::vector<float>{1, 2, 3, 4, 1, 2, 3, 4}));
    EXPECT_EQ(mesh.find_tet_property("c")->values, (std::vector<float>{7, 7}));
}
