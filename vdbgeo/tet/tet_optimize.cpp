#include "vdbgeo/tet/tet_optimize.h"

#include <fmt/format.h>

#include <algorithm>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/tet_flips.h"
#include "vdbgeo/tet/tet_moves.h"
#include "vdbgeo/tet/tet_patches.h"
#include "vdbgeo/tet/tet_store.h"

namespace vdbgeo {
namespace {

/// The vertices of some tetrahedra, and with `ring` those of all tetrahedra around them; sorted.
std::vector<VertexId> vertices_of(const TetStore& store, const std::vector<std::uint32_t>& tets, bool ring) {
    std::vector<bool> seen(store.vertex_count(), false);
    for (const std::uint32_t t : tets)
        for (const VertexId v : store.tet(t)) {
            if (!ring) {
                seen[v] = true;
                continue;
            }
            for (const std::uint32_t n : store.star(v))
                for (const VertexId w : store.tet(n)) seen[w] = true;
        }
    std::vector<VertexId> out;
    for (std::size_t v = 0; v < seen.size(); ++v)
        if (seen[v]) out.push_back(static_cast<VertexId>(v));
    return out;
}

/// Bad tetrahedra none of whose corners a move of its own would make better.
std::vector<std::uint32_t> stuck(const TetStore& store, const std::vector<std::uint32_t>& tried) {
    std::vector<std::uint32_t> tets = store.worse_than(1);
    const auto goes_on = [&](std::uint32_t t) {
        const Tetrahedron& c = store.tet(t);
        return std::any_of(c.begin(), c.end(), [&](VertexId v) {
            return store.freedom(v) != VertexFreedom::fixed && store.changed(v) >= tried[v];
        });
    };
    tets.erase(std::remove_if(tets.begin(), tets.end(), goes_on), tets.end());
    return tets;
}

}  // namespace

void TetOptimizeOptions::check() const {
    if (!(min_dihedral_deg >= 1 && min_dihedral_deg <= 70))
        throw InvalidInput(
            fmt::format("optimize: the smallest dihedral angle is {}°, not in 1…70", min_dihedral_deg));
    if (!(max_dihedral_deg >= 71 && max_dihedral_deg <= 179))
        throw InvalidInput(
            fmt::format("optimize: the largest dihedral angle is {}°, not in 71…179", max_dihedral_deg));
    if (rounds < 0) throw InvalidInput(fmt::format("optimize: {} rounds", rounds));
}

TetOptimizeReport optimize_tets(TetMesh& mesh, const TetOptimizeOptions& options, const Progress& progress) {
    options.check();
    check(mesh, "optimize");
    progress.report(0);
    const DihedralBounds bounds(options.min_dihedral_deg, options.max_dihedral_deg);
    const bool slides = static_cast<bool>(options.onto_surface);
    TetStore store(mesh, bounds, slides);
    TetOptimizeReport report;
    std::vector<std::uint32_t> bad = store.worse_than(1);
    report.outside_before = bad.size();
    std::vector<std::uint32_t> vertices_tried(store.vertex_count(), 0), flips_tried, patches_tried;
    std::uint32_t epoch = 0;
    bool better = true;
    while (report.rounds < options.rounds && !bad.empty() && better) {
        const Progress part = progress.part(static_cast<double>(report.rounds) / options.rounds,
                                            static_cast<double>(report.rounds + 1) / options.rounds);
        // Flips are the cheaper, but a surface that slides needs few of them, and those that come too early
        // tie tetrahedra to it by all their corners.
        std::uint64_t flips = options.flips && !slides ? flip_tets(store, bad, flips_tried, epoch) : 0;
        const bool ring = report.rounds % 2 == 1;  // every second round the vertices around make room
        std::uint64_t moves = move_vertices(store, vertices_of(store, store.worse_than(1), ring),
                                            options.onto_surface, vertices_tried, epoch, part.part(0, 0.8));
        if (options.flips && slides) flips = flip_tets(store, store.worse_than(1), flips_tried, epoch);
        part.report(0.9);
        // Of the few that are left on a sliding surface all, else only those that cannot go on alone.
        moves += move_patches(store, slides ? store.worse_than(1) : stuck(store, vertices_tried),
                              options.onto_surface, patches_tried, epoch);
        part.report(1);
        ++report.rounds;
        report.moves += moves;
        report.flips += flips;
        better = moves + flips > 0 || !ring;
        bad = store.worse_than(1);
    }
    report.outside_after = bad.size();
    if (report.moves + report.flips > 0) {
        store.give_to(mesh);
        set_faces(mesh);
    }
    progress.report(1);
    return report;
}

}  // namespace vdbgeo
