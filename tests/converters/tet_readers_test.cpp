// Other programs read the files of tetrahedra that are written here, and theirs are read: meshio and VTK (in
// Python), Gmsh, TetGen. What is not installed is not tested, and the test says so.
#include <gtest/gtest.h>

#include <sstream>

#include "converters/mesh_file.h"
#include "tests/converters/tet_samples.h"
#include "tests/support/data.h"
#include "tests/support/run.h"

using namespace vdbgeo;
using test::expect_same;
using test::read_bytes;
using test::run;
using test::TempFolder;
using test::volume_of;
using test::write_bytes;

namespace {

const std::string python = "/usr/bin/python3", gmsh = "/usr/bin/gmsh", tetgen = "/usr/bin/tetgen";

bool have_module(const std::string& module) { return run({python, "-c", "import " + module}).code == 0; }

/// Runs a script with the folder as its argument; its output.
std::string python_says(const TempFolder& folder, const std::string& script) {
    write_bytes(folder / "script.py", script);
    const auto r = run({python, (folder / "script.py").string(), folder.path().string()});
    EXPECT_EQ(r.code, 0) << r.err;
    return r.out;
}

/// Two regions without the point that belongs to nothing, which other programs drop.
TetMesh sample(int n = 2) {
    TetMesh mesh = test::two_regions(n);
    mesh.points.pop_back();
    return mesh;
}

void write_all(const TetMesh& mesh, const TempFolder& folder) {
    for (const std::string& ending : tet_endings()) write_tets(mesh, folder / ("m" + ending));
}

/// The same to so many digits, whatever the numbers of vertices and tetrahedra.
void expect_like(const TetMesh& found, const TetMesh& expected, double relative = 1e-12) {
    EXPECT_EQ(found.points.size(), expected.points.size());
    ASSERT_EQ(found.tets.size(), expected.tets.size());
    EXPECT_EQ(found.faces.size(), expected.faces.size());
    EXPECT_NEAR(volume_of(found), volume_of(expected), relative * volume_of(expected));
    for (const std::int32_t region : {3, 7})
        EXPECT_EQ(std::count(found.regions.begin(), found.regions.end(), region),
                  std::count(expected.regions.begin(), expected.regions.end(), region))
            << region;
    for (std::size_t t = 0; t < found.tets.size(); ++t) EXPECT_GT(tet_determinant(found, t), 0);
}

/// Text that rounds to 16 digits far from the origin loses some of a small tetrahedron.
constexpr double rounded = 1e-7;

}  // namespace

TEST(TetReaders, MeshioReadsEachFormat) {
    if (!have_module("meshio")) GTEST_SKIP() << "NOT TESTED: needs python3-meshio";
    const TempFolder folder;
    const TetMesh mesh = sample();
    write_all(mesh, folder);
    std::ostringstream expected;
    const auto of = [&](std::int32_t region) {
        return std::count(mesh.regions.begin(), mesh.regions.end(), region);
    };
    const auto pair = [&](std::array<std::int32_t, 2> p) {
        return std::count(mesh.face_regions.begin(), mesh.face_regions.end(), p);
    };
    const char* labels[] = {"region", "medit:ref", "gmsh:physical", "tetgen:ref", "tetgen:ref"};
    int n = 0;
    for (const std::string& ending : tet_endings()) {
        expected << ending << ' ' << mesh.points.size() << " True True " << labels[n++] << " {3: " << of(3)
                 << ", 7: " << of(7) << "}";
        if (ending == ".vtu")  // the region behind a face
            expected << " {3: " << pair({3, 0}) + pair({3, 7}) << ", 7: " << pair({7, 0}) << "}";
        else if (ending == ".mesh" || ending == ".msh")
            expected << " {1: " << pair({3, 0}) << ", 2: " << pair({3, 7}) << ", 3: " << pair({7, 0}) << "}";
        else
            expected << " {}";
        expected << "\n";
    }
    expected << "boundary_3 2 1, boundary_7 2 3, interface_3_7 2 2, region_3 3 3, region_7 3 7\n";
    EXPECT_EQ(python_says(folder, R"(
import sys, collections, contextlib, io, meshio, numpy as np
folder, first, names = sys.argv[1], None, {}
for ending, key in ((".vtu", "region"), (".mesh", "medit:ref"), (".msh", "gmsh:physical"), (".node", "tetgen:ref"),
                    (".ele", "tetgen:ref")):
    with contextlib.redirect_stdout(io.StringIO()):  # it prints an empty line
        m = meshio.read(folder + "/m" + ending)
    names.update(m.field_data)
    if first is None: first = m.points
    count, positive = {"tetra": collections.Counter(), "triangle": collections.Counter()}, True
    for block, labels in zip(m.cells, m.cell_data[key]):
        count[block.type].update(int(l) for l in labels)
        if block.type == "tetra":
            p = m.points[block.data]
            positive = positive and (np.linalg.det(p[:, 1:] - p[:, :1]) > 0).all()
    print(ending, len(m.points), (np.sort(m.points, axis=0) == np.sort(first, axis=0)).all(), positive, key, dict(sorted(count["tetra"].items())),
          dict(sorted(count["triangle"].items())))
print(", ".join(f"{n} {v[1]} {v[0]}" for n, v in sorted(names.items())))
)"),
              expected.str());
}

TEST(TetReaders, FilesOfMeshioAreRead) {
    if (!have_module("meshio")) GTEST_SKIP() << "NOT TESTED: needs python3-meshio";
    const TempFolder folder;
    const TetMesh mesh = sample();
    write_tets(mesh, folder / "m.vtu");
    python_says(folder, R"(
import sys, meshio, numpy as np
folder = sys.argv[1]
m = meshio.read(folder + "/m.vtu")
labels = {"tetra": "region"}
tets = [c.data for c in m.cells if c.type == "tetra"][0]
regions = [r for c, r in zip(m.cells, m.cell_data["region"]) if c.type == "tetra"][0]
def mesh(key): return meshio.Mesh(m.points, [("tetra", tets)], cell_data={key: [regions]})
for format, key, name in (("vtu", "region", "z.vtu"), ("medit", "medit:ref", "t.mesh"), ("tetgen", "tetgen:ref", "t.node")):
    meshio.write(f"{folder}/{name}", mesh(key), format)
meshio.write(folder + "/a.vtu", mesh("region"), "vtu", binary=False)
meshio.write(folder + "/b.vtu", mesh("region"), "vtu", compression=None)
for binary in (True, False):
    g = mesh("gmsh:physical"); g.cell_data["gmsh:geometrical"] = [regions]
    meshio.write(f"{folder}/two{binary:d}.msh", g, "gmsh22", binary=binary)
    meshio.write(f"{folder}/four{binary:d}.msh", g, "gmsh", binary=binary)
# quadratic: middle nodes appended, one an edge
edges = {}
def middle(a, b): return len(m.points) + edges.setdefault((min(a, b), max(a, b)), len(edges))
ten = np.array([[*t, *(middle(t[a], t[b]) for a, b in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)))] for t in tets])
points = np.vstack([m.points, [(m.points[a] + m.points[b]) / 2 for a, b in edges]])
for name, format, key in (("quadratic.vtu", "vtu", "region"), ("quadratic2.msh", "gmsh22", "gmsh:physical"),
                          ("quadratic4.msh", "gmsh", "gmsh:physical")):
    q = meshio.Mesh(points, [("tetra10", ten)], cell_data={key: [regions]})
    if format != "vtu": q.cell_data["gmsh:geometrical"] = [regions]
    meshio.write(f"{folder}/{name}", q, format)
)");
    for (const char* name :
         {"z.vtu", "b.vtu", "t.mesh", "t.node", "two0.msh", "two1.msh", "quadratic.vtu", "quadratic2.msh"}) {
        SCOPED_TRACE(name);
        expect_same(read_tets(folder / name), mesh);
    }
    expect_like(read_tets(folder / "a.vtu"), mesh, 1e-3);                    // text of eleven digits
    for (const char* name : {"four0.msh", "four1.msh", "quadratic4.msh"}) {  // meshio writes no groups
        SCOPED_TRACE(name);
        const TetMesh back = read_tets(folder / name);
        EXPECT_EQ(back.points, mesh.points);
        EXPECT_EQ(back.tets, mesh.tets);
    }
}

TEST(TetReaders, VtkReadsWhatIsWrittenAndItsFilesAreRead) {
    if (!have_module("vtk")) GTEST_SKIP() << "NOT TESTED: needs VTK's python";
    const TempFolder folder;
    TetMesh mesh = sample();
    MeshProperty x{"x", 1, {}}, volume{"volume", 1, {}};
    for (const Vec3d& p : mesh.points) x.values.push_back(static_cast<float>(p[0]));
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        volume.values.push_back(static_cast<float>(tet_determinant(mesh, t) / 6));
    mesh.vertex_properties = {x};
    mesh.tet_properties = {volume};
    write_tets(mesh, folder / "m.vtu");
    EXPECT_EQ(python_says(folder, R"(
import sys, math, vtk
folder = sys.argv[1]
r = vtk.vtkXMLUnstructuredGridReader(); r.SetFileName(folder + "/m.vtu"); r.Update()
grid = r.GetOutput()
size = vtk.vtkCellSizeFilter(); size.SetInputData(grid); size.Update()
volumes = size.GetOutput().GetCellData().GetArray("Volume")
own, region, outside = (grid.GetCellData().GetArray(n) for n in ("volume", "region", "outside"))
tets = [c for c in range(grid.GetNumberOfCells()) if grid.GetCellType(c) == 10]
faces = [c for c in range(grid.GetNumberOfCells()) if grid.GetCellType(c) == 5]
print(grid.GetPoint(0) is not None, grid.GetPoints().GetDataType() == vtk.VTK_DOUBLE, len(tets), len(faces),
      all(volumes.GetTuple1(c) > 0 and abs(volumes.GetTuple1(c) - own.GetTuple1(c)) < 1e-6 for c in tets),
      all(math.isnan(own.GetTuple1(c)) for c in faces), all(outside.GetTuple1(c) == -1 for c in tets),
      sorted({(region.GetTuple1(c), outside.GetTuple1(c)) for c in faces}))
for mode in ("Ascii", "Binary", "Appended"):
    for packed in (True, False):
        for encode in (True, False):
            for order in ("LittleEndian", "BigEndian"):
                w = vtk.vtkXMLUnstructuredGridWriter(); w.SetInputData(grid)
                w.SetFileName(f"{folder}/{mode}{packed:d}{encode:d}{order}.vtu")
                getattr(w, f"SetDataModeTo{mode}")()
                w.SetEncodeAppendedData(encode)
                w.SetHeaderTypeToUInt64() if packed else w.SetHeaderTypeToUInt32()
                w.SetBlockSize(4096)
                w.SetByteOrderToBigEndian() if order == "BigEndian" else w.SetByteOrderToLittleEndian()
                if not packed: w.SetCompressorTypeToNone()
                w.Write()
)"),
              "True True " + std::to_string(mesh.tets.size()) + " " + std::to_string(mesh.faces.size()) +
                  " True True True [(3.0, 0.0), (3.0, 7.0), (7.0, 0.0)]\n");
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
        if (entry.path().extension() != ".vtu") continue;
        SCOPED_TRACE(entry.path().filename());
        EXPECT_TRUE(holds_tets(entry.path()));
        const TetMesh back = read_tets(entry.path());
        const bool text = entry.path().filename().string().find("Ascii") == 0;  // VTK rounds to 11 digits
        if (text)
            expect_like(back, mesh, 1e-3);
        else
            expect_same(back, mesh);
        ASSERT_NE(back.find_tet_property("volume"), nullptr);
        for (std::size_t t = 0; t < volume.values.size(); ++t)
            EXPECT_NEAR(back.find_tet_property("volume")->values[t], volume.values[t], 1e-6);
        EXPECT_NE(back.find_vertex_property("x"), nullptr);
        ++files;
    }
    EXPECT_EQ(files, 1 + 24);
}

TEST(TetReaders, GmshReadsWhatIsWrittenAndItsFilesAreRead) {
    if (!std::filesystem::exists(gmsh)) GTEST_SKIP() << "NOT TESTED: needs gmsh";
    const TempFolder folder;
    const TetMesh mesh = sample();
    write_all(mesh, folder);
    const auto says = [&](std::vector<std::string> words) {
        words.insert(words.begin(), gmsh);
        words.insert(words.end(), {"-v", "5", "-nt", "1", "-setnumber", "Mesh.SaveGroupsOfNodes", "0"});
        const auto r = run(words);
        EXPECT_EQ(r.code, 0) << r.out << r.err;
        EXPECT_EQ((r.out + r.err).find("Warning"), std::string::npos) << r.out << r.err;
        EXPECT_EQ((r.out + r.err).find("Error"), std::string::npos) << r.out << r.err;
        return r.out + r.err;
    };
    const std::string check = says({"-check", (folder / "m.msh").string()});
    EXPECT_NE(check.find("5 entities"), std::string::npos) << check;
    EXPECT_NE(check.find(std::to_string(mesh.points.size()) + " nodes"), std::string::npos) << check;
    EXPECT_NE(check.find(std::to_string(mesh.tets.size() + mesh.faces.size()) + " elements"),
              std::string::npos)
        << check;
    says({(folder / "m.msh").string(), "-save", "-format", "msh22", "-o", (folder / "two.msh").string()});
    says({(folder / "m.msh").string(), "-save", "-format", "msh22", "-bin", "-o",
          (folder / "two_bin.msh").string()});
    says({(folder / "m.msh").string(), "-save", "-format", "msh41", "-o", (folder / "four.msh").string()});
    says({(folder / "m.msh").string(), "-save", "-format", "msh41", "-bin", "-o",
          (folder / "four_bin.msh").string()});
    says({(folder / "m.mesh").string(), "-save", "-format", "msh41", "-o", (folder / "medit.msh").string()});
    says({(folder / "m.msh").string(), "-save", "-format", "mesh", "-o", (folder / "gmsh.mesh").string()});
    for (const char* name :
         {"two.msh", "two_bin.msh", "four.msh", "four_bin.msh", "medit.msh", "gmsh.mesh"}) {
        SCOPED_TRACE(name);
        expect_like(read_tets(folder / name), mesh, rounded);
    }
    const std::string four = read_bytes(folder / "four.msh");
    for (const char* group : {"2 1 \"boundary_3\"", "2 2 \"interface_3_7\"", "2 3 \"boundary_7\"",
                              "3 3 \"region_3\"", "3 7 \"region_7\""})
        EXPECT_NE(four.find(group), std::string::npos) << group;
    // Gmsh's own mesh of a box, of linear and of quadratic tetrahedra
    write_bytes(
        folder / "box.geo",
        "SetFactory(\"Built-in\"); Mesh.CharacteristicLengthMax = 0.6; Point(1) = {0,0,0}; Extrude {2,0,0} "
        "{ Point{1}; } Extrude {0,1,0} { Curve{1}; } Extrude {0,0,1} { Surface{5}; }\n");
    const std::array<std::array<std::string, 3>, 5> ways{{{"msh22", "1", ""},
                                                          {"msh22", "2", "-bin"},
                                                          {"msh41", "2", ""},
                                                          {"msh41", "1", "-bin"},
                                                          {"mesh", "2", ""}}};
    for (const auto& [format, order, binary] : ways) {
        SCOPED_TRACE(format + order + binary);
        const std::string out = (folder / (format == "mesh" ? "box.mesh" : "box.msh")).string();
        std::vector<std::string> words{
            (folder / "box.geo").string(), "-3", "-order", order, "-format", format, "-o", out};
        if (!binary.empty()) words.push_back(binary);
        says(words);
        const TetMesh box = read_tets(out);
        EXPECT_GT(box.tets.size(), 20u);
        EXPECT_NEAR(volume_of(box), 2, 1e-9);
        for (const auto& pair : box.face_regions) EXPECT_EQ(pair[1], 0);
        const TriMesh surface = boundary_surface(box);
        EXPECT_EQ(surface.points.size() + surface.triangles.size(), 2 + surface.triangles.size() / 2 * 3);
    }
}

TEST(TetReaders, TetgenReadsWhatIsWrittenAndItsFilesAreRead) {
    if (!std::filesystem::exists(tetgen)) GTEST_SKIP() << "NOT TESTED: needs tetgen";
    const TempFolder folder;
    TetMesh mesh = sample();
    for (Vec3d& p : mesh.points) p[2] -= 1e5;  // its output rounds
    write_tets(mesh, folder / "m.node");
    // -r: rebuild a mesh, -g: write it for Medit as well
    auto r = run({tetgen, "-rgC", (folder / "m.node").string()});
    EXPECT_EQ(r.code, 0) << r.out << r.err;
    EXPECT_NE(r.out.find("consistent"), std::string::npos) << r.out;
    EXPECT_EQ(r.out.find("!!"), std::string::npos) << r.out;
    const TetMesh back = read_tets(folder / "m.1.node");
    expect_like(back, mesh, rounded);
    EXPECT_EQ(back.face_regions.size(), mesh.face_regions.size());
    expect_like(read_tets(folder / "m.1.mesh"), back, rounded);
    // its faces have the markers that were written
    std::array<std::size_t, 4> markers{}, expected{};
    std::istringstream faces(read_bytes(folder / "m.1.face"));
    std::size_t count = 0, marked = 0;
    faces >> count >> marked;
    ASSERT_EQ(count, mesh.faces.size());
    for (std::size_t f = 0, number, a, b, c, marker; f < count; ++f) {
        faces >> number >> a >> b >> c >> marker;
        ++markers.at(marker);
    }
    for (const auto& pair : mesh.face_regions) ++expected[pair[0] == 7 ? 3 : pair[1] == 7 ? 2 : 1];
    EXPECT_EQ(markers, expected);
    // quadratic, counted from 0
    r = run({tetgen, "-ro2z", (folder / "m.node").string()});
    EXPECT_EQ(r.code, 0) << r.out << r.err;
    expect_like(read_tets(folder / "m.1.ele"), mesh, rounded);
}

TEST(TetReaders, TetgenMeshesARealSurface) {
    VDBGEO_NEEDS_DATA("ftetwild/bunny.off");
    if (!std::filesystem::exists(tetgen)) GTEST_SKIP() << "NOT TESTED: needs tetgen";
    const TempFolder folder;
    std::filesystem::copy(test::data_folder() / "ftetwild/bunny.off", folder / "bunny.off");
    const auto r = run({tetgen, "-pYQg", (folder / "bunny.off").string()});
    ASSERT_EQ(r.code, 0) << r.out << r.err;
    const TetMesh mesh = read_tets(folder / "bunny.1.ele"), medit = read_tets(folder / "bunny.1.mesh");
    const TriMesh surface = read_mesh(folder / "bunny.off"), boundary = boundary_surface(mesh);
    EXPECT_EQ(boundary.triangles.size(), surface.triangles.size());
    EXPECT_EQ(mesh.tets.size(), medit.tets.size());
    EXPECT_NEAR(volume_of(medit), volume_of(mesh), 1e-6 * volume_of(mesh));
    for (const std::string& ending : tet_endings()) {
        write_tets(mesh, folder / ("again" + ending));
        expect_same(read_tets(folder / ("again" + ending)), mesh);
    }
}
