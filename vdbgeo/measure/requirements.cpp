#include "vdbgeo/measure/requirements.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

std::string counted(std::uint64_t n, const std::string& one, const std::string& many) {
    return fmt::format("{} {}", n, n == 1 ? one : many);
}

std::string boundary_edges(std::uint64_t n) { return counted(n, "boundary edge", "boundary edges"); }

std::string crowded_edges(std::uint64_t n) {
    return counted(n, "edge of three faces or more", "edges of three faces or more");
}

/// "" where nothing is wrong.
std::string what_is_open(const MeshMeasures& m) {
    std::vector<std::string> wrong;
    if (m.boundary_edges > 0)
        wrong.push_back(
            fmt::format("{} in {}", boundary_edges(m.boundary_edges), counted(m.holes, "hole", "holes")));
    if (m.non_manifold_edges > 0) wrong.push_back(crowded_edges(m.non_manifold_edges));
    if (wrong.empty()) return "it has no face with an area";
    return (m.boundary_edges > 0 ? "the surface is open: " : "") + fmt::format("{}", fmt::join(wrong, ", "));
}

std::string what_is_not_manifold(const MeshMeasures& m) {
    std::vector<std::string> wrong;
    if (m.non_manifold_edges > 0) wrong.push_back(crowded_edges(m.non_manifold_edges));
    if (m.non_manifold_vertices > 0)
        wrong.push_back(counted(m.non_manifold_vertices, "vertex", "vertices") + " where surfaces touch");
    if (m.degenerate_faces > 0)
        wrong.push_back(counted(m.degenerate_faces, "face that names", "faces that name") +
                        " a vertex twice");
    return fmt::format("{}", fmt::join(wrong, ", "));
}

}  // namespace

void require(const MeshMeasures& m, const MeshRequirements& needed, const std::string& stage) {
    if (needed.not_empty && m.faces == 0)
        throw InvalidInput(fmt::format("{} needs a mesh that is not empty: it has no faces", stage));
    std::vector<std::string> names, faults;
    bool cap = false;
    if (needed.closed && !m.closed) {
        names.push_back("closed");
        faults.push_back(what_is_open(m));
        cap = m.boundary_edges > 0;
    }
    if (needed.oriented && !m.oriented) {
        names.push_back("oriented");
        faults.push_back(
            counted(m.misoriented_edges, "edge between faces that face", "edges between faces that face") +
            " opposite ways");
    }
    if (needed.manifold && !m.manifold) {
        names.push_back("manifold");
        const std::string fault = what_is_not_manifold(m);
        if (faults.empty() || faults.front() != fault) faults.push_back(fault);
    }
    if (names.empty()) return;
    throw InvalidInput(fmt::format("{} needs a mesh that is {}: {}; try repair{}", stage,
                                   fmt::join(names, ", "), fmt::join(faults, "; "), cap ? " or --cap" : ""));
}

}  // namespace vdbgeo
