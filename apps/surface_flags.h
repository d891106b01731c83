// Flags that say how the surface of a map is made, and which of its pieces are kept.
#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "converters/map_file.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/surface/delaunay_surface.h"
#include "vdbgeo/surface/dual_surface.h"

namespace vdbgeo::app {

/// Which pieces of a mesh are kept.
struct ComponentFlags {
    ComponentFilter filter;

    void add(CLI::App& app);
    bool any() const;
};

/// A level set turned into a density: what is inside is above 0 (and above the negated isovalue).
DensityMap turned_over(const DensityMap& level_set);

struct SurfaceFlags {
    std::string method = "marching-cubes";
    DelaunaySurfaceOptions delaunay;
    DualSurfaceOptions dual;
    std::string radius, distance, mask;  ///< "0.8" voxels or "1.5A"
    bool cap = false;

    void add(CLI::App& app);
    /// Turns texts into options; throws UsageError, for flags of another method too.
    void finish(const CLI::App& app);

    /// The surface at `isovalue`: normals from dense to empty, and from inside out for a level set.
    TriMesh extract(const MapFile& in, double isovalue, const Progress& progress) const;

 private:
    bool radius_in_A_ = false, distance_in_A_ = false;
};

}  // namespace vdbgeo::app
