#include "vdbgeo/remesh/simplify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/surface_distance.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/remesh/edge_collapse.h"

namespace vdbgeo {
namespace {

/// How often the bound on single collapses is drawn in before the input comes back as it is.
constexpr int most_attempts = 16;

TriMesh collapsed(const TriMesh& mesh, std::uint64_t faces, const EdgeCollapse::Allowed& allowed,
                  const Progress& progress) {
    EdgeCollapse collapse(mesh, "simplify");
    if (collapse.faces_left() <= faces) return mesh;
    collapse.run(faces, allowed, progress);
    return collapse.mesh(mesh);
}

/// How far from the input a collapse may go, which is less around places where too much has got lost.
class Reach {
 public:
    Reach(const TriMesh& mesh, double max_distance)
        : mesh_(mesh),
          max_distance_(max_distance),
          reach_(mesh.points.size(), static_cast<float>(0.8 * max_distance)) {}

    /// By samples on what a collapse makes: its vertex, and the middles of its faces and sides.
    bool allows(const TriangleTree& tree, const EdgeCollapse::Proposal& proposal) const {
        const Vec3d centre = proposal.centre.cast<double>();
        const double reach2 = slack2(tree, centre);
        if (reach2 < 0) return false;
        // The mean over no more than 100 planes, say: then none of them is further than half of the reach.
        if (proposal.error < reach2 / 400) return true;
        const auto near = [&](const Vec3d& p) { return slack2(tree, p) >= 0; };
        return std::all_of(proposal.fan.begin(), proposal.fan.end(), [&](const auto& side) {
            const Vec3d a = side.first.template cast<double>(), b = side.second.template cast<double>();
            const Vec3d sum = centre + a + b;
            return near((centre + a) / 2) && near((sum + centre) / 4) && near((sum + a) / 4) &&
                   near((sum + b) / 4);
        });
    }

    /// Halves the reach around the places where the two surfaces are too far from each other, and lowers it a
    /// little elsewhere.
    void draw_in(const TriMesh& result) {
        Array<char> lost;
        lost.assign(mesh_.points.size(), 0);
        mark_left_behind(result, lost);
        mark_astray(result, lost);
        for (int ring = rings(); ring > 0; --ring) widen(lost);
        for (std::size_t v = 0; v < lost.size(); ++v) reach_[v] *= lost[v] ? 0.5f : 0.95f;
    }

 private:
    /// The squared reach at a point's nearest place on the input; −1 where the point is further from there.
    double slack2(const TriangleTree& tree, const Vec3d& p) const {
        const TriangleTree::Nearest found = tree.nearest(p, max_distance_ * max_distance_);
        if (std::isinf(found.squared_distance)) return -1;
        const Triangle& t = mesh_.triangles[found.face];
        const double reach = std::min({reach_[t[0]], reach_[t[1]], reach_[t[2]]});
        return found.squared_distance <= reach * reach ? reach * reach : -1;
    }

    /// Marks the input's vertices that are nearly too far from the result, or whose faces' middles are.
    void mark_left_behind(const TriMesh& result, Array<char>& lost) const {
        const TriangleTree tree(result);
        const double reach = 0.85 * max_distance_;
        const auto far = [&](const Vec3d& p) {
            return std::isinf(tree.nearest(p, reach * reach).squared_distance);
        };
        parallel_for(lost.size(), 1024,
                     [&](std::size_t v) { lost[v] = far(mesh_.points[v].cast<double>()) ? 1 : 0; });
        Array<char> faces(mesh_.triangles.size());
        parallel_for(faces.size(), 1024, [&](std::size_t f) { faces[f] = far(middle(mesh_, f)) ? 1 : 0; });
        for (std::size_t f = 0; f < faces.size(); ++f)
            if (faces[f])
                for (const VertexId v : mesh_.triangles[f]) lost[v] = 1;
    }

    /// Marks the input's vertices next to which a face of the result is too far away.
    void mark_astray(const TriMesh& result, Array<char>& lost) const {
        const TriangleTree tree(mesh_);
        constexpr std::size_t samples = 10;
        Array<std::uint64_t> face(result.triangles.size() * samples);
        parallel_for(face.size(), 1024, [&](std::size_t i) {
            // The middle, and points on the way from it to the corners and to the middles of the sides.
            const Triangle& t = result.triangles[i / samples];
            const std::size_t k = i % samples;
            const auto corner = [&](std::size_t c) { return Vec3d(result.points[t[c % 3]].cast<double>()); };
            Vec3d p = middle(result, i / samples);
            if (k > 6)
                p = (corner(k) + corner(k + 1)) / 2;
            else if (k > 3)
                p = (p + corner(k)) / 2;
            else if (k > 0)
                p = (p + (corner(k) + corner(k + 1)) / 2) / 2;
            const TriangleTree::Nearest found = tree.nearest(p);
            const double reach = 0.95 * max_distance_;
            face[i] = found.squared_distance > reach * reach ? found.face : mesh_.triangles.size();
        });
        for (const std::uint64_t f : face)
            if (f < mesh_.triangles.size())
                for (const VertexId v : mesh_.triangles[f]) lost[v] = 1;
    }

    static Vec3d middle(const TriMesh& mesh, std::size_t f) {
        const Triangle& t = mesh.triangles[f];
        return (mesh.points[t[0]].cast<double>() + mesh.points[t[1]].cast<double>() +
                mesh.points[t[2]].cast<double>()) /
               3;
    }

    /// Rings of neighbours over twice the distance.
    int rings() const {
        double sum = 0;
        for (const Triangle& t : mesh_.triangles)
            sum += double((mesh_.points[t[0]] - mesh_.points[t[1]]).norm());
        const double edge = sum / static_cast<double>(mesh_.triangles.size());
        return edge > 0 ? static_cast<int>(std::clamp(std::ceil(2 * max_distance_ / edge), 2.0, 20.0)) : 2;
    }

    void widen(Array<char>& lost) const {
        const Array<char> before = lost;
        for (const Triangle& t : mesh_.triangles)
            if (before[t[0]] || before[t[1]] || before[t[2]])
                for (const VertexId v : t) lost[v] = 1;
    }

    const TriMesh& mesh_;
    double max_distance_;
    std::vector<float> reach_;  ///< of each vertex of the input
};

TriMesh collapsed_within(const TriMesh& mesh, std::uint64_t faces, double max_distance,
                         const Progress& progress) {
    Reach reach(mesh, max_distance);
    for (int attempt = 0; attempt < most_attempts; ++attempt) {
        const double from = 1 - std::pow(0.5, attempt), to = 1 - std::pow(0.5, attempt + 1);
        TriMesh result;
        {
            const TriangleTree tree(mesh);
            result = collapsed(
                mesh, faces, [&](const EdgeCollapse::Proposal& p) { return reach.allows(tree, p); },
                progress.part(from, (from + to) / 2));
        }
        if (result.triangles.size() == mesh.triangles.size()) break;
        const SurfaceDistance measured =
            surface_distance(result, mesh, {}, progress.part((from + to) / 2, to));
        if (measured.hausdorff <= max_distance) return result;
        reach.draw_in(result);
    }
    return mesh;
}

}  // namespace

void SimplifyOptions::check() const {
    if (!faces && !max_distance)
        throw InvalidInput("simplify: neither a number of faces nor a largest distance is set");
    if (max_distance && !(std::isfinite(*max_distance) && *max_distance > 0))
        throw InvalidInput(
            fmt::format("simplify: largest distance {} A where a number above 0 is needed", *max_distance));
}

TriMesh simplify(const TriMesh& mesh, const SimplifyOptions& options, const Progress& progress) {
    options.check();
    if (mesh.empty()) return mesh;
    const std::uint64_t faces = options.faces.value_or(0);
    if (!options.max_distance) return collapsed(mesh, faces, {}, progress);
    TriMesh result = collapsed_within(mesh, faces, *options.max_distance, progress);
    progress.report(1);
    return result;
}

}  // namespace vdbgeo
