// What others make of the curvature of a mesh.
#pragma once

#include <functional>
#include <memory>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::bench {

struct PeerCurvature {
    Array<double> mean, gauss;
};

/// vtkCurvatures on a mesh that has been handed over already; one thread.
std::function<PeerCurvature()> vtk_curvatures(const TriMesh& mesh);

/// CGAL's Monge_via_jet_fitting, vertex after vertex, one thread; the neighbours are found within.
PeerCurvature cgal_jets(const TriMesh& mesh, int degree, int rings);

}  // namespace vdbgeo::bench
