#include "vdbgeo/tet/filled_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using Counts = std::array<std::uint64_t, 2>;  // points, tetrahedra

template <class Element>
void put(const Array<Element>& from, std::byte*& to) {
    if (from.empty()) return;
    std::memcpy(to, from.data(), from.size() * sizeof(Element));
    to += from.size() * sizeof(Element);
}

template <class Element>
void get(const std::byte*& from, std::uint64_t count, Array<Element>& to) {
    to.resize(count);
    if (count == 0) return;
    std::memcpy(static_cast<void*>(to.data()), from, count * sizeof(Element));
    from += count * sizeof(Element);
}

void check_tets(const Filling& filling, const SolidInput& input, const std::string& who) {
    const auto solids = static_cast<std::int32_t>(input.regions.size());
    for (std::size_t t = 0; t < filling.tets.size(); ++t) {
        for (const VertexId v : filling.tets[t])
            if (v >= filling.points.size())
                throw NumericalError(
                    fmt::format("{}: a tetrahedron names point {} of {}", who, v, filling.points.size()));
        if (filling.solid[t] < 0 || filling.solid[t] >= solids)
            throw NumericalError(
                fmt::format("{}: a tetrahedron is in solid {} of {}", who, filling.solid[t], solids));
    }
}

/// Each tetrahedron and each solid as a whole.
void check_volumes(const TetMesh& mesh, const Array<std::int32_t>& solid, const SolidInput& input,
                   const std::string& who) {
    std::vector<double> volumes(input.regions.size(), 0);
    std::uint64_t turned_over = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const double det = tet_determinant(mesh, t);
        turned_over += !(det > 0);
        volumes[static_cast<std::size_t>(solid[t])] += det / 6;
    }
    if (turned_over > 0)
        throw NumericalError(fmt::format("{}: {} of {} tetrahedra are flat or turned over; try remesh first",
                                         who, turned_over, mesh.tets.size()));
    for (std::size_t s = 0; s < volumes.size(); ++s) {
        const double expected = input.regions[s].volume_A3;
        if (!(std::abs(volumes[s] - expected) <= 1e-6 * expected))
            throw NumericalError(
                fmt::format("{}: it filled {:.9g} Å³ of region {}, whose surface encloses {:.9g} Å³; try "
                            "remesh first, or "
                            "another method",
                            who, volumes[s], input.regions[s].region, expected));
    }
}

/// Corners in ascending order.
Array<Triangle> sorted_faces(Array<Triangle> faces) {
    for (Triangle& t : faces) std::sort(t.begin(), t.end());
    std::sort(faces.begin(), faces.end());
    return faces;
}

/// The faces of the surface between different regions, or a region and the outside.
Array<Triangle> faces_of_regions(const SolidInput& input) {
    Array<Triangle> faces;
    for (std::size_t f = 0; f < input.triangles.size(); ++f) {
        const auto [behind, before] = input.solids[f];
        const auto region = [&](std::int32_t s) { return input.regions[static_cast<std::size_t>(s)].region; };
        if (before == SolidInput::outside || region(behind) != region(before))
            faces.push_back(input.triangles[f]);
    }
    return faces;
}

void check_surface(const TetMesh& mesh, const SolidInput& input, const std::string& who) {
    const bool points_first = mesh.points.size() >= input.points.size() &&
                              std::equal(input.points.begin(), input.points.end(), mesh.points.begin());
    if (!points_first) throw NumericalError(who + ": it did not keep the points of the surface");
    const Array<Triangle> have = sorted_faces(mesh.faces), wanted = sorted_faces(faces_of_regions(input));
    if (have == wanted) return;
    Array<Triangle> missing;
    std::set_difference(wanted.begin(), wanted.end(), have.begin(), have.end(), std::back_inserter(missing));
    throw NumericalError(fmt::format(
        "{}: it did not keep {} of the surface's {} faces; try remesh first, or let it change the surface",
        who, missing.size(), wanted.size()));
}

}  // namespace

std::vector<std::byte> to_bytes(const Filling& filling) {
    const Counts counts{filling.points.size(), filling.tets.size()};
    std::vector<std::byte> bytes(sizeof counts + counts[0] * sizeof(Vec3d) +
                                 counts[1] * (sizeof(Tetrahedron) + sizeof(std::int32_t)));
    std::byte* to = bytes.data();
    std::memcpy(to, counts.data(), sizeof counts);
    to += sizeof counts;
    put(filling.points, to);
    put(filling.tets, to);
    put(filling.solid, to);
    return bytes;
}

Filling filling_from_bytes(const std::vector<std::byte>& bytes, const std::string& who) {
    Counts counts{};
    if (bytes.size() >= sizeof counts) std::memcpy(counts.data(), bytes.data(), sizeof counts);
    constexpr std::uint64_t per_tet = sizeof(Tetrahedron) + sizeof(std::int32_t);
    const bool plausible = counts[0] < 1ull << 40 && counts[1] < 1ull << 40;
    if (!plausible || bytes.size() != sizeof counts + counts[0] * sizeof(Vec3d) + counts[1] * per_tet)
        throw NumericalError(who + ": its result is damaged");
    Filling filling;
    const std::byte* from = bytes.data() + sizeof counts;
    get(from, counts[0], filling.points);
    get(from, counts[1], filling.tets);
    get(from, counts[1], filling.solid);
    return filling;
}

TetMesh filled_mesh(Filling filling, const SolidInput& input, bool kept_surface, const std::string& who) {
    check_tets(filling, input, who);
    TetMesh mesh;
    mesh.points = std::move(filling.points);
    mesh.tets = std::move(filling.tets);
    check_volumes(mesh, filling.solid, input, who);
    mesh.regions.resize(mesh.tets.size());
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        mesh.regions[t] = input.regions[static_cast<std::size_t>(filling.solid[t])].region;
    try {
        set_faces(mesh);
    } catch (const InvalidInput& e) {
        throw NumericalError(fmt::format("{}: its tetrahedra overlap: {}", who, e.what()));
    }
    if (kept_surface) check_surface(mesh, input, who);
    return mesh;
}

}  // namespace vdbgeo
