// convert and info with files of tetrahedra.
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "tests/cli/cli_test.h"
#include "tests/cli/small_memory.h"
#include "tests/converters/tet_samples.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

class TetsFiles : public Cli {
 protected:
    /// Two regions, with a property of vertices and one of tetrahedra.
    TetMesh sample() const {
        TetMesh mesh = two_regions(2);
        mesh.points.pop_back();
        mesh.vertex_properties.push_back({"x", 1, std::vector<float>(mesh.points.size(), 1.5f)});
        mesh.tet_properties.push_back({"id", 1, std::vector<float>(mesh.tets.size(), 2.5f)});
        return mesh;
    }
};

}  // namespace

TEST_F(TetsFiles, EachFormatBecomesEachOther) {
    const TetMesh mesh = sample();
    for (const std::string from : {".vtu", ".mesh", ".msh", ".node"}) {
        write_tets(mesh, at("in" + from));
        for (const std::string to : {".vtu", ".mesh", ".msh", ".ele"}) {
            SCOPED_TRACE(from + " " + to);
            const Json j = json({"convert", at("in" + from), at("out" + to)});
            EXPECT_EQ(j["vertices"], mesh.points.size());
            EXPECT_EQ(j["tets"], mesh.tets.size());
            expect_same(read_tets(at("out" + to)), mesh);
            std::filesystem::remove(at("out" + to));
        }
    }
    EXPECT_EQ(read_tets(at("in.vtu")).tet_properties.size(), 1u);
    const Ended r = good({"convert", at("in.vtu"), at("out.msh"), "--quiet"});
    EXPECT_EQ(r.err, "vdbgeo: warning: " + at("out.msh") + ": properties are left out: only .vtu has them\n");
    EXPECT_EQ(good({"convert", at("in.vtu"), at("out.vtu"), "--quiet"}).err, "");
    EXPECT_EQ(bytes("out.vtu"), bytes("in.vtu"));
}

TEST_F(TetsFiles, TheBoundaryBecomesAMesh) {
    const TetMesh mesh = sample();
    write_tets(mesh, at("in.msh"));
    const TriMesh expected = boundary_surface(mesh);
    for (const std::string& ending : mesh_endings()) {
        if (is_tet_ending("x" + ending)) continue;
        const Json j = json({"convert", at("in.msh"), at("out" + ending)});
        EXPECT_EQ(j["faces"], expected.triangles.size());
        EXPECT_EQ(read_mesh(at("out" + ending)).triangles.size(), expected.triangles.size());
    }
    const TriMesh surface = read_mesh(at("out.ply"));
    EXPECT_EQ(surface.points, expected.points);
    EXPECT_EQ(surface.triangles, expected.triangles);
    ASSERT_NE(surface.find_face_property("region"), nullptr);
    EXPECT_EQ(surface.find_face_property("region")->values, expected.find_face_property("region")->values);
    const Json j = json({"info", at("out.ply")});
    EXPECT_EQ(j["closed"], true);
    EXPECT_EQ(j["kind"], "mesh");
}

TEST_F(TetsFiles, VtuOfTrianglesIsAMeshStill) {
    write_mesh(boundary_surface(sample()), at("surface.vtu"));
    EXPECT_EQ(json({"info", at("surface.vtu")})["kind"], "mesh");
    const Json j = json({"convert", at("surface.vtu"), at("out.ply")});
    EXPECT_TRUE(j.contains("faces"));
    good({"convert", at("out.ply"), at("again.vtu")});
    EXPECT_EQ(bytes("again.vtu"), bytes("surface.vtu"));
    write_tets(sample(), at("tets.vtu"));
    expect_error(vdbgeo({"simplify", at("tets.vtu"), at("out.ply"), "--faces", "10"}), 3, at("tets.vtu"),
                 "is a tetrahedron: only surfaces are read");
}

TEST_F(TetsFiles, InfoTellsCountsRegionsAndBoundary) {
    const TetMesh mesh = sample();
    for (const std::string& ending : tet_endings()) {
        write_tets(mesh, at("in" + ending));
        const Json j = json({"info", at("in" + ending)});
        EXPECT_EQ(j["kind"], "tets");
        EXPECT_EQ(j["vertices"], mesh.points.size());
        EXPECT_EQ(j["tets"], mesh.tets.size());
        ASSERT_EQ(j["regions"].size(), 2u);
        std::size_t tets = 0;
        for (const Json& region : j["regions"]) tets += region["tets"].get<std::size_t>();
        EXPECT_EQ(j["regions"][0]["region"], 3);
        EXPECT_EQ(j["regions"][1]["region"], 7);
        EXPECT_EQ(tets, mesh.tets.size());
        EXPECT_NEAR(j["volume_A3"].get<double>(), volume_of(mesh), 1e-9);
        EXPECT_EQ(j["boundary"]["closed"], true);
        EXPECT_EQ(j["boundary"]["faces"], j["boundary_faces"]);
        EXPECT_EQ(j["boundary_faces"].get<std::size_t>() + j["interface_faces"].get<std::size_t>(),
                  mesh.faces.size());
        EXPECT_EQ(j["properties"].size(), ending == ".vtu" ? 2u : 0u);
    }
    const std::string text = good({"info", at("in.vtu"), "--quiet"}).out;
    for (const char* words : {"kind        tetrahedra", "boundary    ", "interfaces  ", "properties  x, id"})
        EXPECT_NE(text.find(words), std::string::npos) << text;
}

TEST_F(TetsFiles, DamageIsRefusedInALine) {
    write_tets(sample(), at("good.vtu"));
    const auto expect_refused = [&](const Words& words, const std::string& name, const std::string& text) {
        const Ended r = vdbgeo(words, small_memory());
        expect_error(r, 3, at(name), text);
        expect_small(r);
    };
    const auto refused = [&](const std::string& name, const std::string& content, const std::string& text) {
        make(name, content);
        for (const char* out : {"out.vtu", "out.ply", "out.ele"})
            expect_refused({"convert", at(name), at(out)}, name, text);
        expect_refused({"info", at(name)}, name, text);
        for (const char* out : {"out.vtu", "out.ply", "out.ele", "out.node", "out.face"})
            EXPECT_FALSE(std::filesystem::exists(at(out))) << out;
    };
    refused("points.mesh", "MeshVersionFormatted 2\nDimension 3\nVertices\n1000000000\n0 0 0 0\n",
            "1000000000");
    refused("tag.msh",
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n2147483647 0 0 0\n$EndNodes\n$Elements\n1\n"
            "1 4 0 1 2 3 4\n$EndElements\n",
            "line 10: an element names node 1");
    refused(
        "points.vtu",
        "<VTKFile type=\"UnstructuredGrid\"><Piece NumberOfPoints=\"1000000000\" NumberOfCells=\"1\"><Points>"
        "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 "
        "0</DataArray></Points><Cells>"
        "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells></Piece></VTKFile>",
        "expected 3000000000 values, found 3");
    const std::string good = bytes("good.vtu");
    refused("cut.vtu", good.substr(0, good.size() / 2), "that are appended");
    make("a.ele", "1 4 0\n1 1 2 3 4\n");
    refused("a.node", "1000000000 3 0 0\n1 0 0 0\n", "1000000000 entries");
    expect_error(vdbgeo({"info", at("none.msh")}), 4, at("none.msh"));
}

TEST_F(TetsFiles, WhatCannotBeIsSaidSo) {
    write_tets(sample(), at("in.mesh"));
    write_mesh(boundary_surface(sample()), at("surface.ply"));
    phantom("map.mrc", 8);
    expect_error(vdbgeo({"convert", at("in.mesh"), at("out.mrc")}), 2, at("out.mrc"),
                 "tetrahedra become one of");
    expect_error(vdbgeo({"convert", at("surface.ply"), at("out.msh")}), 2, at("out.msh"),
                 "vdbgeo tetrahedralize");
    expect_error(vdbgeo({"convert", at("map.mrc"), at("out.msh")}), 2, at("out.msh"),
                 "vdbgeo tetrahedralize");
    expect_error(vdbgeo({"convert", at("in.mesh"), at("in.mesh"), at("out.msh")}), 2, "",
                 "a series is made of maps");
    expect_error(vdbgeo({"info", at("in.mesh"), "--isovalues"}), 2, at("in.mesh"), "of maps and grids");
    expect_error(vdbgeo({"simplify", at("in.mesh"), at("out.ply"), "--faces", "10"}), 3, at("in.mesh"),
                 "a file of tetrahedra");
}
