// What every closed surface that comes out of an algorithm has to be.
#pragma once

#include <gtest/gtest.h>

#include "vdbgeo/measure/mesh_measures.h"

namespace vdbgeo::test {

/// Expects a closed, oriented manifold without unused vertices; its measures.
inline MeshMeasures expect_closed_manifold(const TriMesh& mesh) {
    const MeshMeasures m = measure_mesh(mesh);  // refuses what check() does
    EXPECT_TRUE(m.closed);
    EXPECT_TRUE(m.oriented);
    EXPECT_TRUE(m.manifold) << m.non_manifold_edges << " edges, " << m.non_manifold_vertices << " vertices";
    EXPECT_EQ(m.unused_vertices, 0u);
    return m;
}

}  // namespace vdbgeo::test
