#include "vdbgeo/tet/tet_components.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;

/// The values of the elements that are kept.
std::vector<float> kept_values(const MeshProperty& property, const std::vector<bool>& keep) {
    std::vector<float> values;
    const auto width = static_cast<std::size_t>(property.components);
    for (std::size_t i = 0; i < keep.size(); ++i)
        if (keep[i])
            values.insert(values.end(), property.values.begin() + static_cast<std::ptrdiff_t>(i * width),
                          property.values.begin() + static_cast<std::ptrdiff_t>((i + 1) * width));
    return values;
}

TetMesh extract(const TetMesh& mesh, const std::vector<bool>& keep) {
    std::vector<bool> used(mesh.points.size(), false);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        if (keep[t])
            for (const VertexId v : mesh.tets[t]) used[v] = true;
    TetMesh out;
    Array<VertexId> number(mesh.points.size());
    for (std::size_t v = 0; v < used.size(); ++v) {
        if (!used[v]) continue;
        number[v] = static_cast<VertexId>(out.points.size());
        out.points.push_back(mesh.points[v]);
    }
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        if (!keep[t]) continue;
        const Tetrahedron& from = mesh.tets[t];
        out.tets.push_back({number[from[0]], number[from[1]], number[from[2]], number[from[3]]});
        if (!mesh.regions.empty()) out.regions.push_back(mesh.regions[t]);
    }
    for (const MeshProperty& p : mesh.vertex_properties)
        out.vertex_properties.push_back({p.name, p.components, kept_values(p, used)});
    for (const MeshProperty& p : mesh.tet_properties)
        out.tet_properties.push_back({p.name, p.components, kept_values(p, keep)});
    set_faces(out);
    return out;
}

}  // namespace

TetComponents tet_components(const TetMesh& mesh) {
    const TetAdjacency adjacency = tet_adjacency(mesh);
    TetComponents out;
    out.of_tet.resize(mesh.tets.size());
    std::fill(out.of_tet.begin(), out.of_tet.end(), none);
    std::vector<std::uint32_t> front;
    for (std::uint32_t seed = 0; seed < mesh.tets.size(); ++seed) {
        if (out.of_tet[seed] != none) continue;
        const auto number = static_cast<std::uint32_t>(out.components.size());
        TetComponent component;
        out.of_tet[seed] = number;
        front.assign(1, seed);
        while (!front.empty()) {
            const std::uint32_t t = front.back();
            front.pop_back();
            ++component.tets;
            component.volume_A3 += tet_determinant(mesh, t) / 6;
            for (const std::uint32_t n : adjacency.neighbour[t])
                if (n != TetAdjacency::none && out.of_tet[n] == none) {
                    out.of_tet[n] = number;
                    front.push_back(n);
                }
        }
        out.components.push_back(component);
    }
    std::vector<std::uint32_t> order(out.components.size()), place(out.components.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return out.components[a].volume_A3 > out.components[b].volume_A3;
    });
    std::vector<TetComponent> sorted;
    for (std::uint32_t i = 0; i < order.size(); ++i) {
        place[order[i]] = i;
        sorted.push_back(out.components[order[i]]);
    }
    out.components = std::move(sorted);
    for (std::uint32_t& c : out.of_tet) c = place[c];
    return out;
}

void TetComponentFilter::check() const {
    if (keep_largest && *keep_largest == 0) throw InvalidInput("keep the largest 0 pieces: at least 1");
    if (!(min_volume_A3 >= 0) || !std::isfinite(min_volume_A3))
        throw InvalidInput(fmt::format("a least volume of {} Å³ is not a number from 0", min_volume_A3));
}

TetMesh filter_tet_components(TetMesh mesh, const TetComponentFilter& filter) {
    filter.check();
    if (!filter.any()) return mesh;
    const TetComponents pieces = tet_components(mesh);
    std::vector<bool> keep_piece(pieces.components.size());
    bool all = true;
    for (std::size_t c = 0; c < keep_piece.size(); ++c) {
        keep_piece[c] = pieces.components[c].volume_A3 >= filter.min_volume_A3 &&
                        (!filter.keep_largest || c < *filter.keep_largest);
        all = all && keep_piece[c];
    }
    if (all) return mesh;
    std::vector<bool> keep(mesh.tets.size());
    for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = keep_piece[pieces.of_tet[t]];
    return extract(mesh, keep);
}

}  // namespace vdbgeo
