#include "vdbgeo/measure/curvature.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/one_ring.h"
#include "vdbgeo/measure/shape_types.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 12;

template <class Value>
MeshProperty scalars(const char* name, std::size_t count, const Value& value) {
    MeshProperty p{name, 1, std::vector<float>(count)};
    parallel_for(count, grain, [&](std::size_t v) { p.values[v] = static_cast<float>(value(v)); });
    return p;
}

MeshProperty vectors(const char* name, const Array<Vec3f>& values) {
    MeshProperty p{name, 3, std::vector<float>(3 * values.size())};
    parallel_for(values.size(), grain, [&](std::size_t v) {
        for (std::size_t a = 0; a < 3; ++a) p.values[3 * v + a] = values[v][static_cast<Eigen::Index>(a)];
    });
    return p;
}

}  // namespace

void Curvatures::resize(std::size_t vertices, bool directions) {
    for (Array<double>* a : {&K, &H, &k1, &k2}) a->resize(vertices);
    for (Array<Vec3f>* a : {&direction1, &direction2}) a->resize(directions ? vertices : 0);
    flags.resize(vertices);
}

void Curvatures::set_undefined(std::size_t v) {
    flags[v] |= curvature_undefined;
    K[v] = H[v] = k1[v] = k2[v] = std::numeric_limits<double>::quiet_NaN();
    if (has_directions()) direction1[v] = direction2[v] = Vec3f::Zero();
}

void Curvatures::set_from_invariants(std::size_t v, double gaussian, double mean) {
    const double root = std::sqrt(std::max(0.0, mean * mean - gaussian));
    K[v] = gaussian;
    H[v] = mean;
    k1[v] = mean + root;
    k2[v] = mean - root;
}

void Curvatures::set_from_principal(std::size_t v, double a, double b) {
    k1[v] = std::max(a, b);
    k2[v] = std::min(a, b);
    K[v] = a * b;
    H[v] = 0.5 * (a + b);
}

void Curvatures::set_from_principal(std::size_t v, double a, double b, Vec3d along_a, Vec3d along_b) {
    if (a < b) std::swap(along_a, along_b);
    set_from_principal(v, a, b);
    direction1[v] = with_stable_sign(along_a).cast<float>();
    direction2[v] = with_stable_sign(along_b).cast<float>();
}

Vec3d with_stable_sign(const Vec3d& axis) {
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    return axis[largest] < 0 ? Vec3d(-axis) : axis;
}

void set_vertex_property(TriMesh& mesh, MeshProperty property) {
    for (MeshProperty& p : mesh.vertex_properties)
        if (p.name == property.name) {
            p = std::move(property);
            return;
        }
    mesh.vertex_properties.push_back(std::move(property));
}

void attach(TriMesh& mesh, const Curvatures& c, double flatness) {
    const std::size_t n = c.size();
    set_vertex_property(mesh, scalars("K", n, [&](std::size_t v) { return c.K[v]; }));
    set_vertex_property(mesh, scalars("H", n, [&](std::size_t v) { return c.H[v]; }));
    set_vertex_property(mesh, scalars("k1", n, [&](std::size_t v) { return c.k1[v]; }));
    set_vertex_property(mesh, scalars("k2", n, [&](std::size_t v) { return c.k2[v]; }));
    const double none = std::numeric_limits<double>::quiet_NaN();
    const auto where_defined = [&](const char* name, const auto& value) {
        set_vertex_property(mesh, scalars(name, n, [&](std::size_t v) {
                                return c.defined(v) ? static_cast<double>(value(c.k1[v], c.k2[v])) : none;
                            }));
    };
    where_defined("shape_index", shape_index);
    where_defined("curvedness", curvedness);
    where_defined("type", [&](double k1, double k2) { return int(surface_type(k1, k2, flatness)); });
    set_vertex_property(mesh, scalars("curvature_flags", n, [&](std::size_t v) { return c.flags[v]; }));
    if (!c.has_directions()) {
        auto& all = mesh.vertex_properties;
        all.erase(std::remove_if(
                      all.begin(), all.end(),
                      [](const MeshProperty& p) { return p.name == "direction1" || p.name == "direction2"; }),
                  all.end());
        return;
    }
    set_vertex_property(mesh, vectors("direction1", c.direction1));
    set_vertex_property(mesh, vectors("direction2", c.direction2));
}

Array<std::uint8_t> curvature_flags(const TriMesh& mesh, const char* stage) {
    check_curvature_input(mesh, stage);
    return curvature_flags(mesh, VertexFaces(mesh), stage);
}

Array<std::uint8_t> curvature_flags(const TriMesh& mesh, const VertexFaces& faces, const char* stage) {
    Array<std::uint8_t> flags(mesh.points.size());
    std::atomic<std::uint64_t> misoriented{0};
    parallel_blocks(flags.size(), grain, [&](std::size_t begin, std::size_t end) {
        OneRing ring(mesh, faces);
        std::uint64_t turned = 0;
        for (std::size_t v = begin; v < end; ++v) {
            ring.fill(static_cast<VertexId>(v));
            flags[v] = ring.flags(ring.has_area(), turned);
        }
        misoriented.fetch_add(turned, std::memory_order_relaxed);
    });
    check_oriented(misoriented, stage);
    return flags;
}

}  // namespace vdbgeo
