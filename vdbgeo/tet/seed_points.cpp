#include "vdbgeo/tet/seed_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/measure/ray_bins.h"
#include "vdbgeo/measure/triangle_tree.h"

namespace vdbgeo {
namespace {

constexpr std::size_t rays_a_space = 8;

struct Ray {
    std::size_t space;
    std::uint32_t face;
    Vec3f start;
    double end = std::numeric_limits<double>::infinity();
};

Vec3d corner(const TriMesh& mesh, std::uint32_t face, std::size_t k) {
    return mesh.points[mesh.triangles[face][k]].cast<double>();
}

/// Twice the face's area as seen along x, positive where it looks along +x.
double projected_area(const TriMesh& mesh, std::uint32_t face) {
    const Vec3d a = corner(mesh, face, 0);
    return (corner(mesh, face, 1) - a).cross(corner(mesh, face, 2) - a).x();
}

/// The rays of all spaces, from sides from which +x leads into the space.
std::vector<Ray> choose_rays(const TriMesh& mesh, const std::vector<std::vector<FaceSide>>& spaces) {
    std::vector<Ray> rays;
    std::vector<std::pair<double, std::uint32_t>> best;
    for (std::size_t s = 0; s < spaces.size(); ++s) {
        best.clear();
        for (const FaceSide side : spaces[s]) {
            const double area = projected_area(mesh, side / 2) * (side % 2 ? 1 : -1);
            if (area > 0) best.emplace_back(-area, side / 2);
        }
        const std::size_t n = std::min(rays_a_space, best.size());
        std::partial_sort(best.begin(), best.begin() + static_cast<std::ptrdiff_t>(n), best.end());
        for (std::size_t i = 0; i < n; ++i) {
            const std::uint32_t face = best[i].second;
            const Vec3d sum = corner(mesh, face, 0) + corner(mesh, face, 1) + corner(mesh, face, 2);
            rays.push_back({s, face, (sum / 3).cast<float>()});
        }
    }
    return rays;
}

/// Where each ray ends at the next face.
void find_ends(const TriMesh& mesh, std::vector<Ray>& rays) {
    std::vector<Vec3f> starts;
    for (const Ray& ray : rays) starts.push_back(ray.start);
    const RayBins bins(starts);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        bins.visit(mesh, mesh.triangles[f], [&](std::uint32_t r, const RayCrossing& crossing) {
            if (rays[r].face != f) rays[r].end = std::min(rays[r].end, crossing.x);
        });
}

}  // namespace

std::vector<std::vector<SeedPoint>> seed_points(const TriMesh& mesh,
                                                const std::vector<std::vector<FaceSide>>& spaces) {
    std::vector<std::vector<SeedPoint>> seeds(spaces.size());
    std::vector<Ray> rays = choose_rays(mesh, spaces);
    if (rays.empty()) return seeds;
    find_ends(mesh, rays);
    const TriangleTree tree(mesh);
    for (const Ray& ray : rays) {
        if (!std::isfinite(ray.end)) continue;
        Vec3f middle = ray.start;
        middle.x() = static_cast<float>((double(ray.start.x()) + ray.end) / 2);
        const Vec3d point = middle.cast<double>();
        const double clearance = std::sqrt(tree.nearest(point).squared_distance);
        if (clearance > 0) seeds[ray.space].push_back({point, clearance});
    }
    for (std::vector<SeedPoint>& of_space : seeds)
        std::stable_sort(of_space.begin(), of_space.end(),
                         [](const SeedPoint& a, const SeedPoint& b) { return a.clearance > b.clearance; });
    return seeds;
}

std::vector<int> winding_numbers(const TriMesh& mesh, const std::vector<Vec3d>& points) {
    std::vector<int> windings(points.size(), 0);
    if (points.empty()) return windings;
    std::vector<Vec3f> starts;
    for (const Vec3d& p : points) starts.push_back(p.cast<float>());
    const RayBins bins(starts);
    for (const Triangle& t : mesh.triangles)
        bins.visit(mesh, t, [&](std::uint32_t ray, const RayCrossing& crossing) {
            windings[ray] += crossing.leaving ? 1 : -1;
        });
    return windings;
}

}  // namespace vdbgeo
