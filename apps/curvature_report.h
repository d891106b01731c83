// The numbers of a surface's curvature: JSON, lines to read, a table of the vertices, a picture.
#pragma once

#include <string>
#include <vector>

#include "apps/session.h"
#include "vdbgeo/measure/curvature.h"
#include "vdbgeo/view/drawing.h"
#include "vdbgeo/view/theme.h"

namespace vdbgeo::app {

/// Curvature of a mesh, and what else is known at its vertices.
struct CurvatureReport {
    const TriMesh& mesh;
    const Curvatures& curvature;
    /// Of the vertices, Å²: of the method's own dual cells where it has some, so that ∫K dA = Σ K A is exact.
    Array<double> areas;
    double flatness = 0;                ///< of the surface types, 1/Å
    std::vector<MeshProperty> sampled;  ///< values of maps at the vertices
};

/// The areas as weights: what is negative or no number is 0.
Array<double> as_weights(Array<double> areas);

/// Counts, area-weighted distributions of H, K, k1, k2, shape_index and curvedness, area by surface type,
/// ∫K dA, ∫H² dA, and the distribution of every sampled value.
/// Cells of negative area (Eq 14 knows such) count in integrals only.
Json curvature_json(const CurvatureReport& report);
std::vector<std::string> curvature_text(const CurvatureReport& report);

/// One line a vertex as CSV: place, area, normal curvature values, directions, type, flags, sampled values.
void write_curvature_table(const CurvatureReport& report, const std::string& path, const Progress& progress);

/// The distributions of k1, k2 and H over the area (cf. the paper's Figs 11–14).
Drawing plot_curvature_histogram(const CurvatureReport& report, const Theme& theme = Theme::light());

/// The area over the plane of k1 and k2, with the borders and the names of the surface types.
Drawing plot_curvature_plane(const CurvatureReport& report, const Theme& theme = Theme::light());

}  // namespace vdbgeo::app
