// VTK's XML files: each encoding that VTK writes, and damage.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "converters/mesh_file.h"
#include "tests/support/data.h"
#include "tests/support/meshes.h"
#include "tests/support/run.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::data_folder;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;

namespace {

template <class T>
std::string bytes_of(const std::vector<T>& values) {
    return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

std::string base64(const std::string& bytes) {
    const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t v = 0;
        for (std::size_t k = 0; k < 3; ++k)
            v = v << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k)
            out += i + k > bytes.size() ? '=' : digits[v >> (18 - 6 * k) & 63];
    }
    return out;
}

/// Length and bytes as VTK puts them in base64.
std::string plain(const std::string& bytes) {
    return base64(bytes_of(std::vector<std::uint32_t>{static_cast<std::uint32_t>(bytes.size())}) + bytes);
}

std::string packed(const std::string& bytes, std::size_t block) {
    std::vector<std::uint32_t> header{static_cast<std::uint32_t>((bytes.size() + block - 1) / block),
                                      static_cast<std::uint32_t>(block),
                                      static_cast<std::uint32_t>(bytes.size() % block)};
    std::string blocks;
    for (std::size_t at = 0; at < bytes.size(); at += block) {
        const std::string part = bytes.substr(at, block);
        uLongf size = ::compressBound(part.size());
        std::string out(size, '\0');
        ::compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(part.data()),
                   part.size());
        header.push_back(static_cast<std::uint32_t>(size));
        blocks += out.substr(0, size);
    }
    return base64(bytes_of(header)) + base64(blocks);
}

std::string file(const std::string& attributes, const std::string& points, const std::string& polygons,
                 const std::string& body) {
    return "<?xml version=\"1.0\"?>\n<!-- <VTKFile> --><VTKFile type=\"PolyData\" version=\"0.1\" "
           "byte_order=\"LittleEndian\" " +
           attributes + ">\n<PolyData><Piece NumberOfPoints=\"" + points + "\" NumberOfPolys='" + polygons +
           "'>" + body + "</Piece></PolyData></VTKFile>\n";
}

std::string array(const std::string& type, const std::string& name, int components, const std::string& format,
                  const std::string& text) {
    return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
           std::to_string(components) + "\" format=\"" + format + "\">\n" + text + "\n</DataArray>";
}

const std::vector<float> square{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

std::string ascii_square(const std::string& connectivity = "0 1 2 3", const std::string& ends = "4",
                         const std::string& more = "") {
    return "<Points>" + array("Float32", "Points", 3, "ascii", "0 0 0 1 0 0 1 1 0 0 1 0") +
           "</Points><Polys>" + array("Int32", "connectivity", 1, "ascii", connectivity) +
           array("Int32", "offsets", 1, "ascii", ends) + "</Polys>" + more;
}

TriMesh read(const std::string& content, const std::string& name = "m.vtp") {
    const TempFolder folder;
    write_bytes(folder / name, content);
    return read_mesh(folder / name);
}

std::string refusal(const std::string& content, const std::string& name = "m.vtp") {
    const TempFolder folder;
    write_bytes(folder / name, content);
    try {
        read_mesh(folder / name);
    } catch (const InvalidInput& error) {
        const std::string text = error.what(), prefix = (folder / name).string() + ": ";
        EXPECT_EQ(text.substr(0, prefix.size()), prefix);
        return text.substr(std::min(prefix.size(), text.size()));
    }
    return "(not refused)";
}

void expect_square(const TriMesh& mesh) {
    ASSERT_EQ(mesh.points.size(), 4u);
    EXPECT_EQ(mesh.points[2], Vec3f(1, 1, 0));
    EXPECT_EQ(mesh.triangles, (Array<Triangle>{{0, 1, 2}, {0, 2, 3}}));
}

}  // namespace

TEST(MeshVtk, EveryEncoding) {
    const std::vector<std::int64_t> corners{0, 1, 2, 3}, ends{4};
    const auto body = [&](const std::string& format, const auto& encode) {
        return "<Points>" + array("Float32", "Points", 3, format, encode(bytes_of(square))) +
               "</Points><Polys>" + array("Int64", "connectivity", 1, format, encode(bytes_of(corners))) +
               array("Int64", "offsets", 1, format, encode(bytes_of(ends))) + "</Polys>";
    };
    expect_square(read(file("", "4", "1", ascii_square())));
    expect_square(read(file("", "4", "1", body("binary", plain))));
    expect_square(read(file("header_type=\"UInt32\" compressor=\"vtkZLibDataCompressor\"", "4", "1",
                            body("binary", [](const std::string& b) { return packed(b, 32768); }))));
    expect_square(read(file("compressor=\"vtkZLibDataCompressor\"", "4", "1",
                            body("binary", [](const std::string& b) { return packed(b, 16); }))));
}

TEST(MeshVtk, CellsOfEveryFlatKind) {
    const std::string grid =
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\"><UnstructuredGrid><Piece "
        "NumberOfPoints=\"4\" "
        "NumberOfCells=\"6\"><CellData>" +
        array("Int8", "id", 1, "ascii", "0 1 2 3 4 -5") + "</CellData><Points>" +
        array("Float64", "Points", 3, "ascii", "0 0 0 1 0 0 1 1 0 0 1 0") + "</Points><Cells>" +
        array("Int32", "connectivity", 1, "ascii", "0 1 2  0  0 1 2 3  0 1 3 2  0 1 3 2  0 1 2 3") +
        array("Int32", "offsets", 1, "ascii", "3 4 8 12 16 20") +
        array("UInt8", "types", 1, "ascii", "5 1 9 8 6 7") + "</Cells></Piece></UnstructuredGrid></VTKFile>";
    const TriMesh mesh = read(grid, "m.vtu");
    EXPECT_EQ(mesh.triangles, (Array<Triangle>{{0, 1, 2},
                                               {0, 1, 2},
                                               {0, 2, 3},
                                               {0, 1, 2},
                                               {0, 2, 3},
                                               {0, 1, 3},
                                               {3, 1, 2},
                                               {0, 1, 2},
                                               {0, 2, 3}}));
    EXPECT_EQ(mesh.find_face_property("id")->values, (std::vector<float>{0, 2, 2, 3, 3, 4, 4, -5, -5}));
    std::string solid = grid;
    solid.replace(solid.find("5 1 9 8 6 7"), 11, "5 1 9 8 6 10");
    EXPECT_EQ(refusal(solid, "m.vtu"),
              "cell 5 is a tetrahedron: only surfaces are read; vdbgeo convert makes one of the tetrahedra's "
              "boundary");
    solid.replace(solid.find("5 1 9 8 6 10"), 12, "5 1 9 8 6 12");
    EXPECT_EQ(refusal(solid, "m.vtu"), "cell 5 is a hexahedron: only surfaces are read");
    solid.replace(solid.find("5 1 9 8 6 12"), 12, "5 1 9 8 6 99");
    EXPECT_EQ(refusal(solid, "m.vtu"), "cell 5 is of type 99: only surfaces are read");
}

TEST(MeshVtk, PiecesAreJoinedAndColoursOfBytesScaled) {
    const std::string colors = "<PointData>" +
                               array("UInt8", "color", 3, "ascii", "255 0 51 0 0 0 0 0 0 0 0 0") +
                               array("Float32", "a &lt;b&gt;", 1, "ascii", "1 2 nan 1e-50") +
                               array("String", "words", 1, "ascii", "x") + "</PointData>";
    const std::string piece = ascii_square("0 1 2 3", "4", colors);
    const TriMesh mesh =
        read(file("", "4", "1", piece + "</Piece><Piece NumberOfPoints=\"4\" NumberOfPolys=\"1\">" + piece));
    EXPECT_EQ(mesh.points.size(), 8u);
    EXPECT_EQ(mesh.triangles[3], (Triangle{4, 6, 7}));
    ASSERT_EQ(mesh.vertex_properties.size(), 2u);
    EXPECT_EQ(mesh.vertex_properties[0].values[12], 1);
    EXPECT_EQ(mesh.vertex_properties[0].values[14], 0.2f);
    EXPECT_EQ(mesh.vertex_properties[1].name, "a <b>");
    EXPECT_EQ(mesh.vertex_properties[1].values[5], 2);
}

TEST(MeshVtk, DamageIsRefusedByName) {
    EXPECT_EQ(refusal("<?xml version=\"1.0\"?><html/>"), "no file of VTK: no element VTKFile");
    EXPECT_EQ(refusal("<VTKFile type=\"ImageData\"></VTKFile>"),
              "byte 0: expected PolyData or an UnstructuredGrid, found 'ImageData'");
    EXPECT_EQ(refusal("<VTKFile type=\"PolyData\">"), "the file ends before </VTKFile>");
    EXPECT_EQ(refusal("<VTKFile type=\"PolyData\" compressor=\"vtkLZ4DataCompressor\"/>"),
              "byte 0: the compressor 'vtkLZ4DataCompressor' is not known");
    EXPECT_EQ(refusal(file("", "5", "1", ascii_square())), "array 'Points': expected 15 values, found 12");
    EXPECT_EQ(refusal(file("", "4294967296", "1", ascii_square())), "4294967296 points, more than 2^32-1");
    EXPECT_EQ(refusal(file("", "-4", "1", ascii_square())).substr(0, 20), "byte 117: NumberOfPo");
    EXPECT_EQ(refusal(file("", "4", "99999999999", ascii_square())),
              "array 'offsets': expected 99999999999 values, found 1");
    EXPECT_EQ(refusal(file("", "4", "1", ascii_square("0 1 2 4"))), "Polys: cell 0 names point 4 of 4");
    EXPECT_EQ(refusal(file("", "4", "1", ascii_square("0 1 2 -1"))), "Polys: cell 0 names point -1 of 4");
    EXPECT_EQ(refusal(file("", "4", "1", ascii_square("0 1 2 3", "5"))),
              "Polys: cell 0 ends at corner 5 of 4");
    EXPECT_EQ(refusal(file("", "4", "1", ascii_square("0 1 2 3", "2"))), "cell 0 of type 7 has 2 corners");
    EXPECT_EQ(refusal(file("", "4", "1", ascii_square("0 1 2 x"))),
              "array 'connectivity': expected a number, found 'x'");
    EXPECT_EQ(refusal(file(
                  "", "4", "1",
                  ascii_square("0 1 2 3", "4",
                               "<PointData>" + array("Float32", "a", 2, "ascii", "1 2 3") + "</PointData>"))),
              "array 'a': expected 8 values, found 3");
    const auto with_points = [&](const std::string& attributes, const std::string& text) {
        return refusal(file(attributes, "4", "1",
                            "<Points>" + array("Float32", "Points", 3, "binary", text) + "</Points>"));
    };
    EXPECT_EQ(with_points("", base64("abc")), "array 'Points': the file ends within it");
    EXPECT_EQ(with_points("", base64(bytes_of(std::vector<std::uint32_t>{0xFFFFFFF0}))),
              "array 'Points': expected 12 values, found 1073741820");
    EXPECT_EQ(with_points("", plain(bytes_of(square)).substr(0, 40)).substr(0, 25),
              "array 'Points': 48 bytes,");
    const std::string zlib = "compressor=\"vtkZLibDataCompressor\"";
    EXPECT_EQ(with_points(zlib, base64(bytes_of(std::vector<std::uint32_t>{1, 0xFFFFFFFF, 0, 4}))),
              "array 'Points': 1 blocks of 4294967295 bytes do not come from 3 bytes");
    EXPECT_EQ(with_points(zlib, base64(bytes_of(std::vector<std::uint32_t>{0xFFFFFFFF, 4, 0}))),
              "array 'Points': 4294967295 blocks, which is too many");
    std::string broken = bytes_of(std::vector<std::uint32_t>{1, 48, 0, 20});
    EXPECT_EQ(with_points(zlib, base64(broken) + base64(std::string(20, 'x'))),
              "array 'Points': block 0 is damaged");
    EXPECT_EQ(
        refusal("<VTKFile type=\"PolyData\"><Piece NumberOfPoints=\"1\"><Points><DataArray type=\"Float32\" "
                "NumberOfComponents=\"3\" format=\"appended\" offset=\"99\"/></Points></Piece><AppendedData "
                "encoding=\"raw\">_abc"),
        "array '': begins at byte 99 of 3 that are appended");
}

TEST(MeshVtk, RealFilesOfCompressedBase64) {
    VDBGEO_NEEDS_DATA("pycurv_embryo/cell_10_T_10.vtp");
    // The same surface as PLY, written by another program.
    const TriMesh mesh = read_mesh(data_folder() / "pycurv_embryo/cell_10_T_10.vtp"),
                  ply = read_mesh(data_folder() / "pycurv_embryo/cell_10_T_10.ply");
    EXPECT_EQ(mesh.points, ply.points);
    EXPECT_EQ(mesh.triangles, ply.triangles);
    ASSERT_NE(mesh.find_vertex_property("Normals"), nullptr);
    EXPECT_EQ(mesh.find_vertex_property("Normals")->values, ply.find_vertex_property("normal")->values);
    const TriMesh curved = read_mesh(data_folder() / "pycurv_embryo/cell_10_T_10.AVV_rh10.vtp");
    EXPECT_EQ(curved.triangles.size(), 1450u);
    EXPECT_GE(curved.face_properties.size(), 15u);
    const MeshProperty* const kappa = curved.find_face_property("kappa_2");
    ASSERT_NE(kappa, nullptr);
    EXPECT_NEAR(*std::min_element(kappa->values.begin(), kappa->values.end()), -0.15481689572, 1e-9);
    EXPECT_NEAR(*std::max_element(kappa->values.begin(), kappa->values.end()), 0.013016701676, 1e-9);
}

TEST(MeshVtk, VtkReadsWhatIsWrittenAndItsFilesAreRead) {
    if (test::run({"/usr/bin/python3", "-c", "import vtk"}).code != 0)
        GTEST_SKIP() << "NOT TESTED: needs VTK's python";
    const TempFolder folder;
    TriMesh mesh = test::icosphere(2, 10);
    MeshProperty x{"x", 1, {}}, normal{"normal", 3, {}}, face{"face", 1, {}};
    for (const Vec3f& p : mesh.points) {
        x.values.push_back(p[0]);
        normal.values.insert(normal.values.end(), {p[0] / 10, p[1] / 10, p[2] / 10});
    }
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) face.values.push_back(static_cast<float>(f));
    mesh.vertex_properties = {x, normal};
    mesh.face_properties = {face};
    write_mesh(mesh, folder / "a.vtp");
    write_mesh(mesh, folder / "a.vtu");
    write_bytes(folder / "convert.py", R"(
import sys, vtk
folder = sys.argv[1]
for ending, reader, writer in (("vtp", vtk.vtkXMLPolyDataReader, vtk.vtkXMLPolyDataWriter),
                               ("vtu", vtk.vtkXMLUnstructuredGridReader, vtk.vtkXMLUnstructuredGridWriter)):
    r = reader(); r.SetFileName(f"{folder}/a.{ending}"); r.Update()
    data = r.GetOutput()
    normals = data.GetPointData().GetNormals()
    print(data.GetNumberOfPoints(), data.GetNumberOfCells(), normals.GetName(),
          data.GetPointData().GetArray("x").GetTuple1(7) == data.GetPoint(7)[0],
          data.GetCellData().GetArray("face").GetTuple1(11))
    for mode in ("Ascii", "Binary", "Appended"):
        for packed in (True, False):
            for encode in (True, False):
                for order in ("LittleEndian", "BigEndian"):
                    w = writer(); w.SetInputData(data); w.SetFileName(f"{folder}/{mode}{packed:d}{encode:d}{order}.{ending}")
                    getattr(w, f"SetDataModeTo{mode}")()
                    w.SetEncodeAppendedData(encode)
                    w.SetHeaderTypeToUInt64() if packed else w.SetHeaderTypeToUInt32()
                    w.SetBlockSize(4096)
                    w.SetByteOrderToBigEndian() if order == "BigEndian" else w.SetByteOrderToLittleEndian()
                    if not packed: w.SetCompressorTypeToNone()
                    w.Write()
    if ending == "vtp":
        for version in (42, 51):
            for binary in (True, False):
                w = vtk.vtkPolyDataWriter(); w.SetInputData(data); w.SetFileVersion(version)
                w.SetFileTypeToBinary() if binary else w.SetFileTypeToASCII()
                w.SetFileName(f"{folder}/old{version}{binary:d}.vtk")
                w.Write()
)");
    const auto r = test::run({"/usr/bin/python3", (folder / "convert.py").string(), folder.path().string()});
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(r.out, "162 320 normal True 11.0\n162 320 normal True 11.0\n");
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
        const std::string ending = entry.path().extension();
        if (ending != ".vtp" && ending != ".vtu" && ending != ".vtk") continue;
        SCOPED_TRACE(entry.path().filename());
        const TriMesh back = read_mesh(entry.path());
        if (entry.path().filename() == "old420.vtk" || entry.path().filename() == "old510.vtk") {
            // as text VTK rounds to six digits or so
            ASSERT_EQ(back.points.size(), mesh.points.size());
            for (std::size_t i = 0; i < mesh.points.size(); ++i)
                EXPECT_LT((back.points[i] - mesh.points[i]).norm(), 1e-4);
            EXPECT_EQ(back.triangles, mesh.triangles);
            EXPECT_EQ(back.find_face_property("face")->values, face.values);
            ++files;
            continue;
        }
        EXPECT_EQ(back.points, mesh.points);
        EXPECT_EQ(back.triangles, mesh.triangles);
        for (const MeshProperty& p : mesh.vertex_properties) {
            ASSERT_NE(back.find_vertex_property(p.name), nullptr);
            EXPECT_EQ(back.find_vertex_property(p.name)->values, p.values);
        }
        ASSERT_NE(back.find_face_property("face"), nullptr);
        EXPECT_EQ(back.find_face_property("face")->values, face.values);
        ++files;
    }
    EXPECT_EQ(files, 2 * (1 + 24) + 4);
}

TEST(MeshVtk, OldFilesOfText) {
    const std::string text =
        "# vtk DataFile Version 3.0\nsquare\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0\n1 1 0 0 1 "
        "0\n"
        "LINES 1 3\n2 0 1\nPOLYGONS 1 5\n4 0 1 2 3\nCELL_DATA 2\nSCALARS id int\nLOOKUP_TABLE default\n7 8\n"
        "POINT_DATA 4\nNORMALS n float\n0 0 1 0 0 1 0 0 1 0 0 1\nFIELD FieldData 1\nH 1 4 double\n1 2 3 4\n";
    const TriMesh mesh = read(text, "m.vtk");
    expect_square(mesh);
    EXPECT_EQ(mesh.find_face_property("id")->values, (std::vector<float>{8, 8}));
    EXPECT_EQ(mesh.find_vertex_property("n")->components, 3);
    EXPECT_EQ(mesh.find_vertex_property("H")->values, (std::vector<float>{1, 2, 3, 4}));
    const auto with = [&](const std::string& old, const std::string& now) {
        std::string bad = text;
        bad.replace(bad.find(old), old.size(), now);
        const std::string message = refusal(bad, "m.vtk");
        return message.substr(message.find(": ") + 2);
    };
    EXPECT_EQ(with("ASCII", "ASCIJ"), "expected ASCII or BINARY, found 'ASCIJ'");
    EXPECT_EQ(with("POLYDATA", "STRUCTURED_GRID"), "expected DATASET POLYDATA: only surfaces are read");
    EXPECT_EQ(with("POINTS 4", "POINTS 400"), "the file ends at value 63 of 1200");
    EXPECT_EQ(with("POINTS 4", "POINTS 9999999999999"), "expected a count, found '9999999999999'");
    EXPECT_EQ(with("4 0 1 2 3", "5 0 1 2 3"), "Polys: cell 0 reaches beyond the 5 values");
    EXPECT_EQ(with("4 0 1 2 3", "4 0 1 2 4"), "cell 0 names point 4 of 4");
    EXPECT_EQ(with("LINES", "LINED"), "'LINED' is not read here");
    EXPECT_EQ(with("id int", "id quaternion"), "expected a type such as float or int, found 'quaternion'");
    EXPECT_EQ(with("ASCII", "BINARY"), "'1' is not read here");
}

TEST(MeshVtk, RealOldFiles) {
    for (const char* name : {"smooth_sphere_r10", "smooth_torus_rr25_csr10"}) {
        const std::string file = std::string("pycurv_curvature/") + name + ".surface.vtk";
        VDBGEO_NEEDS_DATA(file);
        const TriMesh mesh = read_mesh(data_folder() / file);
        EXPECT_GT(mesh.points.size(), 1000u);
        EXPECT_GT(mesh.triangles.size(), 1000u);
    }
}
