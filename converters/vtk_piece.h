// A piece of a VTK file on its way to a mesh.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "converters/vtk_arrays.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::mesh_formats {

/// The arrays of a piece as they are declared: PolyData with sections Points, Polys and Strips, or an
/// unstructured grid with Points and Cells.
struct VtkPiece {
    std::map<std::string, std::uint64_t> counts;            // NumberOfPoints …
    std::map<std::string, std::vector<VtkArray>> sections;  // PointData, Points …

    std::uint64_t count(const char* name) const {
        const auto found = counts.find(name);
        return found == counts.end() ? 0 : found->second;
    }
    const VtkArray* find(const char* section, const char* array) const {
        const auto found = sections.find(section);
        if (found == sections.end()) return nullptr;
        for (const VtkArray& a : found->second)
            if (!array || a.name == array) return &a;
        return nullptr;
    }
};

/// Decodes the arrays and cuts the cells into triangles. Throws InvalidInput "FILE: …".
TriMesh read_piece(const VtkPiece& piece, bool poly_data, const VtkEncoding& encoding,
                   const std::string& file, const Progress& progress);

}  // namespace vdbgeo::mesh_formats
