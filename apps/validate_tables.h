// The tables of the paper that validate reruns: areas, volumes and curvatures of surfaces that are known.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"

namespace vdbgeo::app {

/// One number of a table: ours, and what it is held against where there is something.
struct ValidatedValue {
    std::string name;  ///< "K L2"
    double ours = 0;
    std::optional<double> paper, theory;
    /// Of convergence: log2 of the error at twice the edge length over this one.
    std::optional<double> order, paper_order;
    std::string fault;  ///< why it is worse than it has to be; empty: it is not
};

struct ValidatedRow {
    std::string subject;  ///< "radius 1", "peak, edges 0.1"
    std::string method;   ///< "one ring, Voronoi"
    std::vector<ValidatedValue> values;
};

struct ValidatedTable {
    std::string name;   ///< "3"
    std::string title;  ///< what is measured on what
    std::vector<ValidatedRow> rows;
};

/// "2" to "6", and the rest that has no number in the paper: "patches" of the other types of surface,
/// "irregular" meshes, and "maps": spheres through the whole pipeline.
std::vector<std::string> validated_names();

/// Reruns one table. `quick` leaves out the finest edges and spacings.
ValidatedTable validated_table(const std::string& name, bool quick, const Progress& progress);

}  // namespace vdbgeo::app
