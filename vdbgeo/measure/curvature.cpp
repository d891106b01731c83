#include "vdbgeo/measure/curvature.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/shape_types.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 12;
/// Spacing of floats over mean edge above which a mesh's shape is lost in rounding.
constexpr double coarsest_rounding = 0.01;

bool is_cap(const MeshProperty* caps, std::size_t face) { return caps && caps->values[face] > 0.5f; }

void check_precision(const TriMesh& mesh, const char* stage) {
    struct Sums {
        double length = 0, largest = 0;
    };
    const Sums sums = fixed_order_reduce(
        mesh.triangles.size(), grain, Sums{},
        [&](std::size_t begin, std::size_t end) {
            Sums s;
            for (std::size_t f = begin; f < end; ++f)
                for (std::size_t k = 0; k < 3; ++k) {
                    const Vec3d a = mesh.points[mesh.triangles[f][k]].cast<double>();
                    s.length += (mesh.points[mesh.triangles[f][(k + 1) % 3]].cast<double>() - a).norm();
                    s.largest = std::max(s.largest, a.cwiseAbs().maxCoeff());
                }
            return s;
        },
        [](Sums& to, const Sums& part) {
            to.length += part.length;
            to.largest = std::max(to.largest, part.largest);
        });
    const double edge = sums.length / (3 * static_cast<double>(mesh.triangles.size()));
    const float largest = static_cast<float>(sums.largest);
    const double spacing = std::nextafter(largest, std::numeric_limits<float>::infinity()) - largest;
    if (spacing > coarsest_rounding * edge)
        throw InvalidInput(fmt::format(
            "{}: coordinates up to {:.6g} Å are rounded to {:.2g} Å, and edges are {:.3g} Å long on average: "
            "too coarse for curvature; move the mesh to the origin before it is written",
            stage, sums.largest, spacing, edge));
}

/// The flags of v, and whether an edge of v has two faces that run through it in the same direction.
std::uint8_t flags_of(const TriMesh& mesh, const MeshProperty* caps, VertexStar& star, bool& misoriented) {
    bool area = false, any = false, cap = true, border = false, bad = false;
    for (std::uint32_t s = 0; s < star.face_count(); ++s) {
        any = true;
        if (is_cap(caps, star.face(s))) continue;
        cap = false;
        const Triangle& t = mesh.triangles[star.face(s)];
        const Vec3d a = mesh.points[t[0]].cast<double>();
        area |= (mesh.points[t[1]].cast<double>() - a).cross(mesh.points[t[2]].cast<double>() - a).norm() > 0;
    }
    if (any && cap) return curvature_cap | curvature_undefined;
    std::uint32_t kept = 0;
    star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
        const VertexStar::Spoke* faces[2];
        int count = 0;
        for (const VertexStar::Spoke* s = first; s != last; ++s)
            if (!is_cap(caps, star.face(s->slot))) {
                if (count < 2) faces[count] = s;
                ++count;
            }
        border |= count == 1;
        bad |= count > 2;
        if (count == 2) {
            misoriented |= faces[0]->out == faces[1]->out;
            star.join(faces[0]->slot, faces[1]->slot);
        }
    });
    for (std::uint32_t s = 0; s < star.face_count(); ++s)
        kept += !is_cap(caps, star.face(s)) && star.fan(s) == s;
    std::uint8_t flags = border ? curvature_border : 0;
    if (!area || bad || kept != 1) flags |= curvature_undefined;
    return flags;
}

void put(TriMesh& mesh, MeshProperty property) {
    for (MeshProperty& p : mesh.vertex_properties)
        if (p.name == property.name) {
            p = std::move(property);
            return;
        }
    mesh.vertex_properties.push_back(std::move(property));
}

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

void attach(TriMesh& mesh, const Curvatures& c, double flatness) {
    const std::size_t n = c.size();
    put(mesh, scalars("K", n, [&](std::size_t v) { return c.K[v]; }));
    put(mesh, scalars("H", n, [&](std::size_t v) { return c.H[v]; }));
    put(mesh, scalars("k1", n, [&](std::size_t v) { return c.k1[v]; }));
    put(mesh, scalars("k2", n, [&](std::size_t v) { return c.k2[v]; }));
    const double none = std::numeric_limits<double>::quiet_NaN();
    const auto where_defined = [&](const char* name, const auto& value) {
        put(mesh, scalars(name, n, [&](std::size_t v) {
                return c.defined(v) ? static_cast<double>(value(c.k1[v], c.k2[v])) : none;
            }));
    };
    where_defined("shape_index", shape_index);
    where_defined("curvedness", curvedness);
    where_defined("type", [&](double k1, double k2) { return int(surface_type(k1, k2, flatness)); });
    put(mesh, scalars("curvature_flags", n, [&](std::size_t v) { return c.flags[v]; }));
    if (!c.has_directions()) return;
    put(mesh, vectors("direction1", c.direction1));
    put(mesh, vectors("direction2", c.direction2));
}

Array<std::uint8_t> curvature_flags(const TriMesh& mesh, const char* stage) {
    check(mesh, stage);
    if (!mesh.empty()) check_precision(mesh, stage);
    const VertexFaces faces(mesh);
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (caps && caps->components != 1) caps = nullptr;
    Array<std::uint8_t> flags(mesh.points.size());
    std::atomic<std::uint64_t> misoriented{0};
    parallel_blocks(flags.size(), grain, [&](std::size_t begin, std::size_t end) {
        VertexStar star;
        for (std::size_t v = begin; v < end; ++v) {
            star.fill(mesh, faces, static_cast<VertexId>(v));
            bool turned = false;
            flags[v] = flags_of(mesh, caps, star, turned);
            if (turned) misoriented.fetch_add(1, std::memory_order_relaxed);
        }
    });
    if (misoriented > 0)
        throw InvalidInput(fmt::format(
            "{}: the sign of curvature needs faces that are turned the same way, but at {} vertices two run "
            "through an edge in the same direction; try repair (a Möbius strip has no outside)",
            stage, misoriented.load()));
    return flags;
}

}  // namespace vdbgeo
