#include "vdbgeo/measure/self_intersections.h"

#include "vdbgeo/core/errors.h"

#ifdef VDBGEO_HAS_CGAL

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/box_intersection_d.h>
#include <CGAL/intersections.h>

#include <algorithm>
#include <array>

namespace vdbgeo {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Corners = std::array<Point, 3>;
using Pair = std::pair<std::uint32_t, std::uint32_t>;

class Box : public CGAL::Box_intersection_d::Box_d<float, 3, CGAL::Box_intersection_d::ID_NONE> {
 public:
    using ID = std::size_t;
    Box(std::array<float, 3> low, std::array<float, 3> high, std::uint32_t face)
        : CGAL::Box_intersection_d::Box_d<float, 3, CGAL::Box_intersection_d::ID_NONE>(low.data(),
                                                                                       high.data()),
          face_(face) {}
    ID id() const { return face_; }
    std::uint32_t face() const { return face_; }

 private:
    std::uint32_t face_;
};

Corners corners(const TriMesh& mesh, const Triangle& t) {
    Corners c;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3f& p = mesh.points[t[k]];
        c[k] = Point(static_cast<double>(p.x()), static_cast<double>(p.y()), static_cast<double>(p.z()));
    }
    return c;
}

/// Two faces at a common edge (a, b): only where they lie in one plane on the same side of it do they
/// overlap.
bool folded(const Point& a, const Point& b, const Point& c, const Point& d) {
    return CGAL::coplanar(a, b, c, d) && CGAL::coplanar_orientation(a, b, c, d) == CGAL::POSITIVE;
}

bool cut(const TriMesh& mesh, const Triangle& s, const Triangle& t) {
    std::array<std::size_t, 3> in_s{}, in_t{};
    std::size_t shared = 0;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            if (s[i] == t[j]) {
                in_s[shared] = i;
                in_t[shared] = j;
                ++shared;
            }
    if (shared == 3) return true;
    const Corners p = corners(mesh, s), q = corners(mesh, t);
    if (shared == 2) {
        const std::size_t i = 3 - in_s[0] - in_s[1], j = 3 - in_t[0] - in_t[1];
        return folded(p[in_s[0]], p[in_s[1]], p[i], q[j]);
    }
    const Kernel::Triangle_3 a(p[0], p[1], p[2]), b(q[0], q[1], q[2]);
    if (shared == 0) return CGAL::do_intersect(a, b);
    const std::size_t i = in_s[0], j = in_t[0];
    return CGAL::do_intersect(a, Kernel::Segment_3(q[(j + 1) % 3], q[(j + 2) % 3])) ||
           CGAL::do_intersect(b, Kernel::Segment_3(p[(i + 1) % 3], p[(i + 2) % 3]));
}

std::vector<Box> face_boxes(const TriMesh& mesh) {
    std::vector<Box> boxes;
    boxes.reserve(mesh.triangles.size());
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Corners c = corners(mesh, mesh.triangles[f]);
        if (CGAL::collinear(c[0], c[1], c[2])) continue;
        const Triangle& t = mesh.triangles[f];
        std::array<float, 3> low, high;
        for (int a = 0; a < 3; ++a) {
            const std::array<float, 3> v = {mesh.points[t[0]][a], mesh.points[t[1]][a], mesh.points[t[2]][a]};
            low[static_cast<std::size_t>(a)] = *std::min_element(v.begin(), v.end());
            high[static_cast<std::size_t>(a)] = *std::max_element(v.begin(), v.end());
        }
        boxes.emplace_back(low, high, static_cast<std::uint32_t>(f));
    }
    return boxes;
}

}  // namespace

bool have_self_intersections() { return true; }

std::vector<Pair> self_intersections(const TriMesh& mesh, const Progress& progress) {
    check(mesh, "mesh");
    if (mesh.triangles.size() > 0xFFFFFFFFull)
        throw InvalidInput("self-intersections are sought in up to 2^32 faces");
    std::vector<Box> boxes = face_boxes(mesh);
    progress.report(0.1);
    std::vector<const Box*> order;
    order.reserve(boxes.size());
    for (const Box& b : boxes) order.push_back(&b);
    std::vector<Pair> found;
    std::uint64_t tested = 0;
    // A face meets about twelve neighbours: each pair once.
    const double expected = 8.0 * static_cast<double>(boxes.size()) + 1;
    CGAL::box_self_intersection_d(
        order.begin(), order.end(),
        [&](const Box* a, const Box* b) {
            if ((++tested & 0xFFFF) == 0) {
                const double part = static_cast<double>(tested) / expected;
                progress.report(0.1 + 0.9 * part / (1 + part));
            }
            if (cut(mesh, mesh.triangles[a->face()], mesh.triangles[b->face()]))
                found.emplace_back(std::min(a->face(), b->face()), std::max(a->face(), b->face()));
        },
        std::ptrdiff_t{200});
    std::sort(found.begin(), found.end());
    progress.report(1);
    return found;
}

}  // namespace vdbgeo

#else

namespace vdbgeo {

bool have_self_intersections() { return false; }

std::vector<std::pair<std::uint32_t, std::uint32_t>> self_intersections(const TriMesh&, const Progress&) {
    throw InvalidInput("finding self-intersections needs CGAL, which this build does not have");
}

}  // namespace vdbgeo

#endif
