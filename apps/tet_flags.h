// Flags that say how a map, a segmentation or a surface becomes tetrahedra.
#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/surface/delaunay_surface.h"
#include "vdbgeo/tet/delaunay_tetrahedra.h"
#include "vdbgeo/tet/isosurface_stuffing.h"
#include "vdbgeo/tet/netgen_tetrahedra.h"
#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/tet/tetgen_tetrahedra.h"

namespace vdbgeo::app {

/// What the tetrahedra are made from.
enum class TetSource { map, labels, mesh };

/// A length in units (voxels of a map, mean edges of a mesh), or in Å.
struct LengthFlag {
    std::string text;  ///< as given: "0.8" or "1.5A"
    double value = 0;
    bool in_A = false;

    bool given() const { return !text.empty(); }
    double in_units(double unit_A) const { return in_A ? value / unit_A : value; }
    double in_angstrom(double unit_A) const { return in_A ? value : value * unit_A; }
};

/// The methods, in the order of the table of --compare.
const std::vector<std::string>& tet_methods();

class TetFlags {
 public:
    std::string method;  ///< empty: by the source
    bool optimize = false;
    std::string optimize_bounds = "20:130";

    void add(CLI::App& app);
    /// Turns texts into options; throws UsageError.
    void finish(const CLI::App& app);
    /// UsageError for flags that this method does not have.
    void refuse_others(const CLI::App& app, const std::string& method) const;
    /// The method for a source, checked: UsageError where it cannot take it, or is not in this build.
    std::string method_for(TetSource source) const;
    /// The command-line words that the flags of this method were given by.
    std::vector<std::string> words_of(const CLI::App& app, const std::string& method) const;

    // Options with lengths in voxels of `unit_A`, or mean edges.
    StuffingOptions stuffing(double unit_A) const;
    DelaunayTetrahedraOptions delaunay(double unit_A) const;
    TetgenOptions tetgen() const;
    NetgenOptions netgen(double unit_A) const;
    /// The surface that TetGen and NetGen fill, of a map.
    DelaunaySurfaceOptions surface(double unit_A) const;
    TetOptimizeOptions optimizer() const { return optimize_; }
    bool cell_given() const { return cell_.given(); }
    /// "curvature", "density" or empty; and the range of sizes in Å.
    const std::string& size_by() const { return size_by_; }
    double size_low() const { return size_low_; }
    double size_high() const { return size_high_; }

 private:
    /// Larger triangles than a surface for looking at has, and nearer to the isosurface: volumes count here.
    static DelaunaySurfaceOptions coarse_but_near() {
        DelaunaySurfaceOptions o;
        o.radius = 1.2;
        o.distance = 0.2;
        return o;
    }

    std::optional<double> angle_, radius_edge_, min_dihedral_, sliver_bound_, max_volume_;
    LengthFlag cell_, radius_, distance_, cell_size_, max_edge_;
    StuffingOptions stuffing_;
    DelaunayTetrahedraOptions delaunay_;
    TetgenOptions tetgen_;
    NetgenOptions netgen_;
    DelaunaySurfaceOptions surface_ = coarse_but_near();
    TetOptimizeOptions optimize_;
    bool split_surface_ = false;
    std::string size_by_, size_range_;
    double size_low_ = 0, size_high_ = 0;
    std::uint64_t max_tets_ = 50'000'000;
    double max_seconds_ = 3600;
};

}  // namespace vdbgeo::app
