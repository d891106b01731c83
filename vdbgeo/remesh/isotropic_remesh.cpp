#include "vdbgeo/remesh/isotropic_remesh.h"

#include <fmt/format.h>

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

void check_positive(double value, const char* name) {
    if (!(std::isfinite(value) && value > 0))
        throw InvalidInput(fmt::format("remesh: {} {} is not a positive length", name, value));
}

double mean_edge_length(const TriMesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k)
            sum += (mesh.points[t[k]] - mesh.points[t[(k + 1) % 3]]).cast<double>().norm();
    return sum / (3 * static_cast<double>(mesh.triangles.size()));
}

double area(const TriMesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        sum += area_vector(mesh.points[t[0]].cast<double>(), mesh.points[t[1]].cast<double>(),
                           mesh.points[t[2]].cast<double>())
                   .norm();
    return sum / 2;
}

/// Before anything is split: half-edges are counted by 31 bits.
void check_size(const TriMesh& mesh, double length) {
    const double faces = area(mesh) / (std::sqrt(3.0) / 4 * length * length);
    if (faces > 3e8)
        throw InvalidInput(
            fmt::format("remesh: edges of {} Å are about {:.1e} faces, more than 3e8; longer ones are needed",
                        length, faces));
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
    const double length = options.adaptive ? options.adaptive->min_length
                                           : options.target_length.value_or(mean_edge_length(mesh));
    check_positive(length, "mean edge length");
    if (!options.adaptive) check_size(mesh, length);
    const FaceAdjacency adjacency = face_adjacency(mesh, "remesh");
    const InputSurface input(mesh, adjacency, options.feature_angle_deg, length / 2);
    const std::vector<float> lengths = options.adaptive ? curvature_lengths(input, *options.adaptive)
                                                        : std::vector<float>{static_cast<float>(length)};
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
