#include "vdbgeo/remesh/corner_table.h"

#include <fmt/format.h>

#include <algorithm>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

/// The corners of each vertex, in one list after the other.
struct CornerTable::Outgoing {
    Array<std::uint32_t> begin;  ///< of each vertex's list; one more at the end
    Array<Corner> corners;

    Outgoing(const Array<Face>& faces, std::size_t vertices) {
        begin.assign(vertices + 1, 0);
        for (const Face& face : faces)
            for (const VertexId v : face.vertices) ++begin[v];
        std::uint32_t sum = 0;
        for (std::uint32_t& count : begin) count = sum += count;
        corners.resize(3 * faces.size());
        for (std::size_t f = faces.size(); f-- > 0;)
            for (std::uint32_t i = 3; i-- > 0;)
                corners[--begin[faces[f].vertices[i]]] = static_cast<Corner>(4 * f + i);
    }
};

struct CornerTable::Defects {
    std::uint64_t crowded = 0, turned = 0;
};

CornerTable::CornerTable(const TriMesh& mesh, const std::string& stage) {
    check(mesh, stage);
    if (mesh.triangles.size() > max_faces)
        throw InvalidInput(fmt::format("{}: {} faces, more than 2^30", stage, mesh.triangles.size()));
    faces_.resize(mesh.triangles.size());
    parallel_for(faces_.size(), 4096, [&](std::size_t f) {
        for (std::size_t i = 0; i < 3; ++i) faces_[f].vertices[i] = mesh.triangles[f][i];
    });
    const std::uint64_t repeated = static_cast<std::uint64_t>(
        std::count_if(mesh.triangles.begin(), mesh.triangles.end(),
                      [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }));
    const auto refuse = [&](const std::string& why) {
        throw InvalidInput(fmt::format("{} needs a manifold mesh: {}; try repair", stage, why));
    };
    if (repeated > 0) refuse(fmt::format("{} faces name a vertex twice", repeated));
    const Outgoing outgoing(faces_, mesh.points.size());
    const Defects defects = match(outgoing);
    if (defects.crowded > 0) refuse(fmt::format("{} edges have more than two faces", defects.crowded));
    if (defects.turned > 0) refuse(fmt::format("across {} edges one face is turned over", defects.turned));
    const std::uint64_t pinched = find_fans(outgoing);
    if (pinched > 0) refuse(fmt::format("{} vertices have more than one fan of faces", pinched));
}

/// Finds the opposite corners; counts the edges that have none or too many.
CornerTable::Defects CornerTable::match(const Outgoing& outgoing) {
    // The corner that looks at the edge from → to, and how often that direction occurs.
    const auto look = [&](VertexId from, VertexId to, std::uint32_t& count, Corner& found) {
        for (std::uint32_t k = outgoing.begin[from]; k < outgoing.begin[from + 1]; ++k) {
            const Corner c = outgoing.corners[k];
            if (vertex(next(c)) != to) continue;
            if (count++ == 0) found = previous(c);
        }
    };
    return fixed_order_reduce(
        faces_.size(), 4096, Defects{},
        [&](std::size_t begin, std::size_t end) {
            Defects part;
            for (std::size_t f = begin; f < end; ++f)
                for (std::uint32_t i = 0; i < 3; ++i) {
                    const Corner c = static_cast<Corner>(4 * f + i);
                    const VertexId from = vertex(next(c)), to = vertex(previous(c));
                    std::uint32_t along = 0, against = 0;
                    Corner mine = none, other = none;
                    look(from, to, along, mine);
                    look(to, from, against, other);
                    opposite(c) = other;
                    // Each edge is counted once: at its first corner in its first direction.
                    if (mine != c || (against > 0 && from > to)) continue;
                    if (along + against > 2)
                        ++part.crowded;
                    else if (along == 2)
                        ++part.turned;
                }
            return part;
        },
        [](Defects& all, const Defects& part) {
            all.crowded += part.crowded;
            all.turned += part.turned;
        });
}

/// Sets the first corner of every vertex; returns how many have corners that are not reached from it.
std::uint64_t CornerTable::find_fans(const Outgoing& outgoing) {
    first_.resize(outgoing.begin.size() - 1);
    return fixed_order_reduce(
        first_.size(), 4096, std::uint64_t{0},
        [&](std::size_t begin, std::size_t end) {
            std::uint64_t pinched = 0;
            for (std::size_t v = begin; v < end; ++v) {
                const std::uint32_t count = outgoing.begin[v + 1] - outgoing.begin[v];
                if (count == 0) {
                    first_[v] = none;
                    continue;
                }
                const Corner some = outgoing.corners[outgoing.begin[v]];
                Corner start = some;
                for (Corner c = right(some); c != none && c != some; c = right(c)) start = c;
                if (right(start) != none) start = some;
                first_[v] = start;
                std::uint32_t reached = 1;
                for (Corner c = left(start); c != none && c != start; c = left(c)) ++reached;
                if (reached != count) ++pinched;
            }
            return pinched;
        },
        [](std::uint64_t& all, std::uint64_t part) { all += part; });
}

}  // namespace vdbgeo
