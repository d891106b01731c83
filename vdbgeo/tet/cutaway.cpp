#include "vdbgeo/tet/cutaway.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/hidden_edges.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/tet_adjacency.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/tet/tet_quality.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 14;
constexpr std::uint32_t none = TetAdjacency::none;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// A corner of an output face: a point of the mesh (a = b), or where the plane crosses the edge a < b.
using Corner = std::pair<VertexId, VertexId>;

struct Face {
    std::array<Corner, 3> corners;
    std::uint32_t tet;
    bool interior;
    int hidden_edges = 0;  ///< as hidden_edges_property has them
};
using Faces = std::vector<Face>;

std::array<Corner, 3> as_corners(const Triangle& t) {
    return {Corner{t[0], t[0]}, Corner{t[1], t[1]}, Corner{t[2], t[2]}};
}

Triangle face_of(const TetMesh& mesh, std::size_t t, std::size_t k) {
    Triangle face{};
    for (std::size_t c = 0; c < 3; ++c) face[c] = mesh.tets[t][index(tet_faces[k][c])];
    return face;
}

/// Calls part(begin, end, faces) for blocks of the tetrahedra in parallel; the faces in their order.
template <class Part>
Faces collect(const TetMesh& mesh, const Part& part) {
    return fixed_order_reduce(
        mesh.tets.size(), block, Faces{},
        [&](std::size_t begin, std::size_t end) {
            Faces faces;
            for (std::size_t t = begin; t < end; ++t) part(t, faces);
            return faces;
        },
        [](Faces& all, const Faces& some) { all.insert(all.end(), some.begin(), some.end()); });
}

/// The boundary of the tetrahedra that are not gone.
Faces whole_faces(const TetMesh& mesh, const TetAdjacency& adjacency, const Array<std::uint8_t>& gone) {
    return collect(mesh, [&](std::size_t t, Faces& faces) {
        if (gone[t]) return;
        for (std::size_t k = 0; k < 4; ++k) {
            const std::uint32_t n = adjacency.neighbour[t][k];
            if (n == none || gone[n])
                faces.push_back({as_corners(face_of(mesh, t, k)), static_cast<std::uint32_t>(t), n != none});
        }
    });
}

Array<std::uint8_t> beyond(const TetMesh& mesh, const CutawayOptions::Plane& plane) {
    Array<std::uint8_t> gone(mesh.tets.size());
    parallel_for(mesh.tets.size(), 4096, [&](std::size_t t) {
        Vec3d sum = Vec3d::Zero();
        for (const VertexId v : mesh.tets[t]) sum += mesh.points[v] - plane.point;
        gone[t] = sum.dot(plane.normal) > 0;
    });
    return gone;
}

/// Cuts tetrahedra with a plane. A point on the plane counts as beyond it, and an edge that ends there is
/// crossed at that point: so there are three cases only (one, two or three corners stay), and what the plane
/// does not really cut comes out as faces with a corner twice, which are left out.
class FlatCut {
 public:
    FlatCut(const TetMesh& mesh, const CutawayOptions::Plane& plane)
        : mesh_(mesh), distance_(mesh.points.size()) {
        using Box = std::pair<Vec3d, Vec3d>;
        const double huge = std::numeric_limits<double>::infinity();
        const Box box = fixed_order_reduce(
            mesh.points.size(), block, Box{Vec3d::Constant(huge), Vec3d::Constant(-huge)},
            [&](std::size_t begin, std::size_t end) {
                Box b{mesh.points[begin], mesh.points[begin]};
                for (std::size_t v = begin; v < end; ++v)
                    b = {b.first.cwiseMin(mesh.points[v]), b.second.cwiseMax(mesh.points[v])};
                return b;
            },
            [](Box& all, const Box& b) {
                all = {all.first.cwiseMin(b.first), all.second.cwiseMax(b.second)};
            });
        const double near = 1e-12 * (box.second - box.first).norm();
        parallel_for(mesh.points.size(), 4096, [&](std::size_t v) {
            const double d = plane.normal.dot(mesh.points[v] - plane.point);
            distance_[v] = std::abs(d) <= near ? 0 : d;
        });
    }

    Faces faces(const TetAdjacency& adjacency) const {
        return collect(mesh_, [&](std::size_t t, Faces& faces) { cut(adjacency, t, faces); });
    }

    Vec3d point(const Corner& c) const {
        const Vec3d &a = mesh_.points[c.first], &b = mesh_.points[c.second];
        if (c.first == c.second) return a;
        const double from = distance_[c.first], to = distance_[c.second];
        return (to * a - from * b) / (to - from);
    }

 private:
    bool stays(VertexId v) const { return distance_[v] < 0; }

    /// Where the plane crosses the edge from `in`, which stays, to `out`, which does not.
    Corner crossing(VertexId in, VertexId out) const {
        if (distance_[out] == 0) return {out, out};
        return std::minmax(in, out);
    }

    void cut(const TetAdjacency& adjacency, std::size_t t, Faces& faces) const {
        const Tetrahedron& v = mesh_.tets[t];
        int staying = 0;
        for (const VertexId corner : v) staying += stays(corner);
        if (staying == 0) return;
        if (staying < 4) {
            // Where a face lies in the plane and nothing is beyond it, it was there before.
            bool interior = true;
            for (std::size_t k = 0; k < 4 && staying == 1; ++k) {
                const Triangle f = face_of(mesh_, t, k);
                const auto flat = [&](VertexId c) { return distance_[c] == 0; };
                if (std::all_of(f.begin(), f.end(), flat)) interior = adjacency.neighbour[t][k] != none;
            }
            add(section(v, staying), t, interior, faces);
        }
        for (std::size_t k = 0; k < 4; ++k)
            if (adjacency.neighbour[t][k] == none) add(clipped(face_of(mesh_, t, k)), t, false, faces);
    }

    /// The cut through a tetrahedron, counter-clockwise seen from beyond.
    std::vector<Corner> section(const Tetrahedron& v, int staying) const {
        // The corners as an even permutation, those that stay first.
        static constexpr int pairs[6][4] = {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2},
                                            {1, 2, 0, 3}, {1, 3, 2, 0}, {2, 3, 0, 1}};
        if (staying == 2)
            for (const auto& p : pairs) {
                const VertexId a = v[index(p[0])], b = v[index(p[1])], c = v[index(p[2])], d = v[index(p[3])];
                if (stays(a) && stays(b))
                    return {crossing(a, c), crossing(a, d), crossing(b, d), crossing(b, c)};
            }
        for (std::size_t k = 0; k < 4; ++k) {
            if (stays(v[k]) != (staying == 1)) continue;
            const auto& f = tet_faces[k];
            const VertexId p = v[index(f[0])], q = v[index(f[1])], r = v[index(f[2])];
            if (staying == 1) return {crossing(v[k], p), crossing(v[k], q), crossing(v[k], r)};
            return {crossing(p, v[k]), crossing(r, v[k]), crossing(q, v[k])};
        }
        return {};
    }

    /// What is left of a face of the old boundary.
    std::vector<Corner> clipped(const Triangle& f) const {
        std::vector<Corner> polygon;
        for (std::size_t c = 0; c < 3; ++c) {
            const VertexId here = f[c], next = f[(c + 1) % 3];
            if (stays(here)) polygon.emplace_back(here, here);
            if (stays(here) != stays(next))
                polygon.push_back(stays(here) ? crossing(here, next) : crossing(next, here));
        }
        return polygon;
    }

    /// The triangles of a polygon of up to four corners, some of which may be the same.
    void add(std::vector<Corner> polygon, std::size_t t, bool interior, Faces& faces) const {
        polygon.erase(std::unique(polygon.begin(), polygon.end()), polygon.end());
        while (polygon.size() > 1 && polygon.front() == polygon.back()) polygon.pop_back();
        if (polygon.size() < 3) return;
        const auto tet = static_cast<std::uint32_t>(t);
        if (polygon.size() == 4 && (point(polygon[1]) - point(polygon[3])).squaredNorm() <
                                       (point(polygon[0]) - point(polygon[2])).squaredNorm())
            std::rotate(polygon.begin(), polygon.begin() + 1, polygon.end());
        // The diagonal of a quadrilateral is opposite to corner 1 of its first triangle, 2 of the other.
        const bool quad = polygon.size() == 4;
        for (std::size_t i = 2; i < polygon.size(); ++i)
            faces.push_back(
                {{polygon[0], polygon[i - 1], polygon[i]}, tet, interior, quad ? i == 2 ? 2 : 4 : 0});
    }

    const TetMesh& mesh_;
    Array<double> distance_;
};

/// The tetrahedron behind the face that a peel begins at.
std::uint32_t seed_tet(const TetMesh& mesh, const TetAdjacency& adjacency, const CutawayOptions::Peel& peel) {
    std::uint64_t face = peel.seed_face.value_or(0);
    if (mesh.faces.empty()) throw InvalidInput("the mesh's faces are not set: there is none to begin at");
    if (!peel.seed_face) {
        std::uint64_t number = TriangleTree(boundary_surface(mesh)).nearest(peel.from).face;
        for (face = 0; mesh.face_regions[face][1] != 0 || number-- != 0;) ++face;
    }
    if (face >= mesh.faces.size())
        throw InvalidInput(fmt::format("seed face {}: the mesh has {}", face, mesh.faces.size()));
    Triangle wanted = mesh.faces[face];
    std::sort(wanted.begin(), wanted.end());
    const std::uint32_t found = fixed_order_reduce(
        mesh.tets.size(), block, none,
        [&](std::size_t begin, std::size_t end) {
            for (std::size_t t = begin; t < end; ++t)
                for (std::size_t k = 0; k < 4; ++k) {
                    if (adjacency.neighbour[t][k] != none) continue;
                    Triangle f = face_of(mesh, t, k);
                    std::sort(f.begin(), f.end());
                    if (f == wanted) return static_cast<std::uint32_t>(t);
                }
            return none;
        },
        [](std::uint32_t& all, std::uint32_t part) { all = std::min(all, part); });
    if (found == none) throw InvalidInput(fmt::format("seed face {} is not on the boundary", face));
    return found;
}

Array<std::uint8_t> peeled(const TetMesh& mesh, const TetAdjacency& adjacency,
                           const CutawayOptions::Peel& peel) {
    Array<std::uint8_t> gone(mesh.tets.size());
    std::fill(gone.begin(), gone.end(), std::uint8_t{0});
    std::vector<std::uint32_t> queue{seed_tet(mesh, adjacency, peel)};
    if (peel.count == 0) return gone;
    gone[queue[0]] = 1;
    // What is in the queue goes, as far as the count reaches: a mark is set when a tetrahedron is put in.
    for (std::size_t at = 0; at < queue.size() && queue.size() < peel.count; ++at) {
        std::array<std::uint32_t, 4> next = adjacency.neighbour[queue[at]];
        std::sort(next.begin(), next.end());  // none is the largest number
        for (const std::uint32_t n : next) {
            if (n == none || gone[n] || queue.size() == peel.count) continue;
            gone[n] = 1;
            queue.push_back(n);
        }
    }
    return gone;
}

/// The faces as a mesh; point_of tells where a corner is.
template <class PointOf>
TriMesh as_mesh(const Faces& faces, const PointOf& point_of) {
    // The old boundary's vertices, in the order of the mesh, those on edges last.
    std::vector<Corner> shared;
    for (const Face& f : faces)
        if (!f.interior) shared.insert(shared.end(), f.corners.begin(), f.corners.end());
    const auto order = [](const Corner& a, const Corner& b) {
        return std::tuple(a.first != a.second, a) < std::tuple(b.first != b.second, b);
    };
    std::sort(shared.begin(), shared.end(), order);
    shared.erase(std::unique(shared.begin(), shared.end()), shared.end());

    TriMesh out;
    if (shared.size() + 3 * faces.size() > TriMesh::max_vertices)
        throw InvalidInput(fmt::format("the cutaway has {} faces, more than can be numbered", faces.size()));
    for (const Corner& c : shared) out.points.push_back(point_of(c).template cast<float>());
    for (const Face& f : faces) {
        Triangle t{};
        for (std::size_t k = 0; k < 3; ++k) {
            if (f.interior) {
                t[k] = static_cast<VertexId>(out.points.size());
                out.points.push_back(point_of(f.corners[k]).template cast<float>());
            } else {
                const auto at = std::lower_bound(shared.begin(), shared.end(), f.corners[k], order);
                t[k] = static_cast<VertexId>(at - shared.begin());
            }
        }
        out.triangles.push_back(t);
    }
    return out;
}

void set_properties(const TetMesh& mesh, const Faces& faces, TriMesh& out) {
    constexpr std::size_t count = 5;
    const char* const names[count] = {interior_property, "region", "min_dihedral_deg", "radius_edge",
                                      "volume_A3"};
    const float nothing = std::numeric_limits<float>::quiet_NaN();
    std::array<std::vector<float>, count> of_faces, of_vertices;
    for (std::size_t i = 0; i < count; ++i) {
        of_faces[i].resize(faces.size());
        of_vertices[i].assign(out.points.size(), i == 0 ? 0 : nothing);
    }
    parallel_for(faces.size(), 1024, [&](std::size_t f) {
        const Tetrahedron& v = mesh.tets[faces[f].tet];
        const TetShape shape =
            tet_shape(mesh.points[v[0]], mesh.points[v[1]], mesh.points[v[2]], mesh.points[v[3]]);
        const double values[count] = {faces[f].interior ? 1.0 : 0.0,
                                      static_cast<double>(mesh.region(faces[f].tet)), shape.min_dihedral_deg,
                                      shape.radius_edge, shape.volume};
        for (std::size_t i = 0; i < count; ++i) {
            of_faces[i][f] = static_cast<float>(values[i]);
            if (!faces[f].interior) continue;
            for (const VertexId corner : out.triangles[f]) of_vertices[i][corner] = of_faces[i][f];
        }
    });
    for (std::size_t i = 0; i < count; ++i) {
        out.face_properties.push_back({names[i], 1, std::move(of_faces[i])});
        out.vertex_properties.push_back({names[i], 1, std::move(of_vertices[i])});
    }
    const auto hides = [](const Face& f) { return f.hidden_edges != 0; };
    if (std::none_of(faces.begin(), faces.end(), hides)) return;
    MeshProperty hidden{hidden_edges_property, 1, {}};
    for (const Face& f : faces) hidden.values.push_back(static_cast<float>(f.hidden_edges));
    out.face_properties.push_back(std::move(hidden));
}

}  // namespace

void CutawayOptions::check() const {
    if (plane.has_value() == peel.has_value())
        throw InvalidInput("a cutaway is by a plane or by peeling: one of them");
    if (plane && !plane->point.allFinite())
        throw InvalidInput("the plane's point has a coordinate that is not a finite number");
    if (plane && !(plane->normal.allFinite() && plane->normal.stableNorm() > 0))
        throw InvalidInput("the plane's normal has no direction");
    if (peel && !peel->seed_face && !peel->from.allFinite())
        throw InvalidInput("the place to peel from has a coordinate that is not a finite number");
}

TriMesh cutaway(const TetMesh& mesh, const CutawayOptions& options, const Progress& progress) {
    options.check();
    check(mesh, "mesh");
    if (mesh.empty()) throw InvalidInput("the mesh has no tetrahedra: there is nothing to cut");
    progress.report(0);
    const TetAdjacency adjacency = tet_adjacency(mesh);
    progress.report(0.6);
    const auto corner = [&](const Corner& c) { return mesh.points[c.first]; };
    Faces faces;
    TriMesh out;
    if (options.peel) {
        faces = whole_faces(mesh, adjacency, peeled(mesh, adjacency, *options.peel));
        out = as_mesh(faces, corner);
    } else {
        CutawayOptions::Plane plane = *options.plane;
        plane.normal.stableNormalize();
        if (plane.whole_tets) {
            faces = whole_faces(mesh, adjacency, beyond(mesh, plane));
            out = as_mesh(faces, corner);
        } else {
            const FlatCut cut(mesh, plane);
            faces = cut.faces(adjacency);
            out = as_mesh(faces, [&](const Corner& c) { return cut.point(c); });
        }
    }
    if (faces.empty()) throw NumericalError("no tetrahedron is left: take less away");
    progress.report(0.9);
    set_properties(mesh, faces, out);
    progress.report(1);
    return out;
}

}  // namespace vdbgeo
