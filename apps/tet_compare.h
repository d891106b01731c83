// All tetrahedralizers on one input: a table and a picture.
#pragma once

#include <string>
#include <vector>

#include "apps/session.h"

namespace vdbgeo::app {

/// What one method gave: the JSON result of `vdbgeo tetrahedralize`, or its error.
struct MethodRun {
    std::string method;
    std::string file;   ///< the mesh that it wrote
    std::string error;  ///< empty: it went well
    double wall_seconds = 0;
    Json result;
};

/// Runs this program once for each method, each in a process of its own (so that times and peak memory are
/// its own, and a method that fails spoils no other), with `words` behind the method's own flags.
MethodRun run_method(const std::string& in, const std::string& method, const std::string& file,
                     const std::vector<std::string>& words, const Session& session, const Progress& progress);

/// The table as CSV: one line a method, units in the names of the columns.
std::string comparison_csv(const std::vector<MethodRun>& runs);
/// The same in aligned columns, for people.
std::vector<std::string> comparison_text(const std::vector<MethodRun>& runs);

/// The meshes cut open in the middle, side by side at one scale, coloured by their smallest dihedral angles.
void draw_comparison(const std::vector<MethodRun>& runs, const std::string& title, const std::string& path,
                     const Progress& progress);

}  // namespace vdbgeo::app
