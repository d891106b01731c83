#include "vdbgeo/remesh/isotropic_remesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/remesh/angle_polish.h"
#include "vdbgeo/remesh/curvature_lengths.h"
#include "vdbgeo/remesh/input_surface.h"
#include "vdbgeo/remesh/remesh_state.h"

namespace vdbgeo {
namespace {

/// Angles that the last step still works on.
constexpr double least_angle_deg = 33;
/// A small piece whose edges are longer by this is a needle or a flake that no even triangles can be made of.
constexpr double needle_share = 0.3;

void check_positive(double value, const char* name) {
    if (!(std::isfinite(value) && value > 0))
        throw InvalidInput(fmt::format("remesh: {} {} is not a positive length", name, value));
}

struct Size {
    double area = 0, edges = 0;  ///< Å², Å
    std::uint64_t faces = 0;

    void add(const TriMesh& mesh, const Triangle& t) {
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        area += area_vector(a, b, c).norm() / 2;
        edges += (a - b).norm() + (b - c).norm() + (c - a).norm();
        ++faces;
    }
    double mean_edge() const { return edges / (3 * static_cast<double>(faces)); }
};

Size size_of(const TriMesh& mesh) {
    Size size;
    for (const Triangle& t : mesh.triangles) size.add(mesh, t);
    return size;
}

/// The piece that each vertex belongs to, numbered from 0; unused vertices are in piece 0.
std::vector<std::uint32_t> pieces_of_vertices(const TriMesh& mesh, const FaceAdjacency& adjacency,
                                              std::uint32_t& count) {
    constexpr std::uint32_t none = FaceAdjacency::none;
    std::vector<std::uint32_t> piece(mesh.points.size(), none);
    std::vector<VertexId> stack;
    count = 0;
    for (VertexId seed = 0; seed < piece.size(); ++seed) {
        if (piece[seed] != none || adjacency.outgoing[seed] == none) continue;
        const auto visit = [&](VertexId v) {
            if (piece[v] == none) piece[v] = count, stack.push_back(v);
        };
        visit(seed);
        while (!stack.empty()) {
            const std::uint32_t first = adjacency.outgoing[stack.back()];
            stack.pop_back();
            std::uint32_t h = first;
            do {
                for (const VertexId v : mesh.triangles[h / 3]) visit(v);
                h = adjacency.around(h);
            } while (h != none && h != first);
        }
        ++count;
    }
    std::replace(piece.begin(), piece.end(), none, 0u);
    return piece;
}

/// Small pieces get shorter edges, so that some 60 faces are left of each: fewer would take away most of its
/// area. Of needles and flakes that would make very many; those are only polished, which a negative length
/// says. `lengths`: one for each vertex, or one for all where all are the same.
void fit_to_pieces(const TriMesh& mesh, const FaceAdjacency& adjacency, std::vector<float>& lengths) {
    std::uint32_t count = 0;
    const std::vector<std::uint32_t> piece = pieces_of_vertices(mesh, adjacency, count);
    std::vector<Size> sizes(count);
    for (const Triangle& t : mesh.triangles) sizes[piece[t[0]]].add(mesh, t);
    std::vector<float> most(count);
    for (std::uint32_t i = 0; i < count; ++i) most[i] = static_cast<float>(0.2 * std::sqrt(sizes[i].area));
    if (lengths.size() == 1) {
        if (std::none_of(most.begin(), most.end(), [&](float m) { return m < lengths[0]; })) return;
        lengths.resize(mesh.points.size(), lengths[0]);
    }
    for (std::size_t v = 0; v < lengths.size(); ++v) {
        const std::uint32_t i = piece[v];
        if (most[i] < lengths[v])
            lengths[v] = most[i] < needle_share * sizes[i].mean_edge() ? -most[i] : most[i];
    }
}

/// Before anything is split: half-edges are counted by 31 bits.
void check_size(double area, double length) {
    const double faces = area / (std::sqrt(3.0) / 4 * length * length);
    if (faces > 3e8)
        throw InvalidInput(
            fmt::format("remesh: edges of {} Å are about {:.1e} faces, more than 3e8; longer ones are needed",
                        length, faces));
}

/// The same for lengths that follow the curvature, one a vertex; dust has none.
void check_size(const TriMesh& mesh, const std::vector<float>& lengths) {
    double faces = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.points[t[0]].cast<double>();
        const double area =
            0.5 * (mesh.points[t[1]].cast<double>() - a).cross(mesh.points[t[2]].cast<double>() - a).norm();
        const double length = (double(lengths[t[0]]) + lengths[t[1]] + lengths[t[2]]) / 3;
        if (length > 0) faces += area / (std::sqrt(3.0) / 4 * length * length);
    }
    if (faces > 3e8)
        throw InvalidInput(
            fmt::format("remesh: these lengths are about {:.1e} faces, more than 3e8; a greater error or "
                        "least length is needed",
                        faces));
}

}  // namespace

void IsotropicRemeshOptions::check() const {
    if (target_length) check_positive(*target_length, "target length");
    if (adaptive) {
        check_positive(adaptive->min_length, "least length");
        check_positive(adaptive->max_length, "greatest length");
        check_positive(adaptive->error, "error");
        if (adaptive->min_length > adaptive->max_length)
            throw InvalidInput(fmt::format("remesh: least length {} is above the greatest, {}",
                                           adaptive->min_length, adaptive->max_length));
    }
    if (iterations < 0)
        throw InvalidInput(fmt::format("remesh: {} iterations; 0 or more are needed", iterations));
    if (feature_angle_deg && !(*feature_angle_deg > 0 && *feature_angle_deg < 180))
        throw InvalidInput(
            fmt::format("remesh: feature angle {}° is not between 0° and 180°", *feature_angle_deg));
}

TriMesh isotropic_remesh(const TriMesh& mesh, const IsotropicRemeshOptions& options,
                         const Progress& progress) {
    options.check();
    check(mesh, "remesh");
    if (mesh.empty() || options.iterations == 0) return mesh;
    const Size size = size_of(mesh);
    const double length =
        options.adaptive ? options.adaptive->min_length : options.target_length.value_or(size.mean_edge());
    check_positive(length, "mean edge length");
    if (!options.adaptive) check_size(size.area, length);
    const FaceAdjacency adjacency = face_adjacency(mesh, "remesh");
    const InputSurface input(mesh, adjacency, options.feature_angle_deg, length / 2);
    std::vector<float> lengths = options.adaptive ? curvature_lengths(input, *options.adaptive)
                                                  : std::vector<float>{static_cast<float>(length)};
    if (options.adaptive) check_size(mesh, lengths);
    fit_to_pieces(mesh, adjacency, lengths);
    RemeshState state(input, lengths);
    progress.report(0.1);
    for (int i = 0; i < options.iterations; ++i) {
        const bool last = 2 * i >= options.iterations;
        state.split_long(4.0 / 3);
        // Half way at first: what is much finer than the target becomes even before it becomes coarse.
        if (i == 0) state.collapse_short(0.4, 4.0 / 3);
        state.collapse_short(0.8, 4.0 / 3);
        if (i == 0) state.compact();
        if (last)
            state.flip_for_angles();
        else
            state.flip_for_valence();
        state.relax(0.7);
        progress.report(0.1 + 0.7 * (i + 1) / options.iterations);
    }
    state.flip_for_angles();
    polish_angles(state, least_angle_deg);
    progress.report(1);
    return state.result();
}

}  // namespace vdbgeo
