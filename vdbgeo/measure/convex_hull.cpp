#include "vdbgeo/measure/convex_hull.h"

#include <fmt/format.h>

#include "vdbgeo/core/errors.h"

#ifdef VDBGEO_HAS_CGAL

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

constexpr std::size_t few = 4000;  ///< not worth a filter
constexpr std::size_t grain = 1 << 14;
constexpr std::size_t many = 100000;  ///< worth a fine one

bool before(const Vec3f& a, const Vec3f& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Even directions on a sphere, on a spiral.
std::vector<Vec3f> directions(int count) {
    std::vector<Vec3f> all;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, r = std::sqrt(1 - z * z), turn = 2.399963229728653 * i;
        all.push_back(Vec3d(r * std::cos(turn), r * std::sin(turn), z).cast<float>());
    }
    return all;
}

/// Every stride-th point's extremes in these directions, the first of equals.
std::vector<std::size_t> extremes(const Array<Vec3f>& points, const std::vector<Vec3f>& along,
                                  std::size_t stride) {
    using Best = std::vector<std::pair<float, std::size_t>>;
    const Best none(along.size(), {-std::numeric_limits<float>::infinity(), 0});
    const Best best = fixed_order_reduce(
        points.size() / stride, grain, none,
        [&](std::size_t begin, std::size_t end) {
            Best b = none;
            for (std::size_t i = begin; i < end; ++i)
                for (std::size_t d = 0; d < along.size(); ++d) {
                    const float reach = along[d].dot(points[i * stride]);
                    if (reach > b[d].first) b[d] = {reach, i * stride};
                }
            return b;
        },
        [](Best& to, const Best& part) {
            for (std::size_t d = 0; d < to.size(); ++d)
                if (part[d].first > to[d].first) to[d] = part[d];
        });
    std::vector<std::size_t> found;
    for (const auto& [reach, i] : best) found.push_back(i);
    return found;
}

/// The hull of points that are sorted and differ; empty where they have no volume.
TriMesh quickhull(const Array<Vec3f>& sorted) {
    TriMesh hull;
    if (sorted.size() < 4) return hull;
    std::vector<Point> points;
    points.reserve(sorted.size());
    for (const Vec3f& p : sorted) points.emplace_back(double(p.x()), double(p.y()), double(p.z()));
    const bool volume = std::any_of(points.begin(), points.end(), [&](const Point& p) {
        return !CGAL::collinear(points.front(), points.back(), p);
    });
    if (!volume) return hull;
    CGAL::Surface_mesh<Point> mesh;
    CGAL::convex_hull_3(points.begin(), points.end(), mesh);
    if (mesh.number_of_faces() < 4 || mesh.number_of_faces() != 2 * mesh.number_of_vertices() - 4)
        return hull;
    std::vector<VertexId> order(mesh.number_of_vertices()), place(order.size());
    std::vector<Vec3f> corners;
    for (const auto v : mesh.vertices()) {
        const Point& p = mesh.point(v);
        corners.push_back(Vec3d(p.x(), p.y(), p.z()).cast<float>());
    }
    std::iota(order.begin(), order.end(), VertexId{0});
    std::sort(order.begin(), order.end(),
              [&](VertexId a, VertexId b) { return before(corners[a], corners[b]); });
    for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = static_cast<VertexId>(i);
    for (const VertexId v : order) hull.points.push_back(corners[v]);
    for (const auto f : mesh.faces()) {
        Triangle t{};
        std::size_t k = 0;
        for (const auto v : CGAL::vertices_around_face(mesh.halfedge(f), mesh))
            t[k++] = place[static_cast<std::size_t>(v)];
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        hull.triangles.push_back(t);
    }
    std::sort(hull.triangles.begin(), hull.triangles.end());
    return hull;
}

void sort_unique(Array<Vec3f>& points) {
    for (Vec3f& p : points) p += Vec3f::Zero();  // −0 and 0 are one place
    tbb::parallel_sort(points.begin(), points.end(), before);
    points.erase(std::unique(points.begin(), points.end(),
                             [](const Vec3f& a, const Vec3f& b) { return (a.array() == b.array()).all(); }),
                 points.end());
}

/// Tells what is inside a convex body, by the square of a cube around its centre that a place is seen
/// through. Where p = centre + t · (1, a, b) (1 along the longest component) the body ends at t with
/// 1/t = max n·(1, a, b)/d over its faces, which is convex in (a, b): over a square it is largest at a
/// corner.
class Inside {
 public:
    Inside(const TriMesh& body, int squares) : squares_(squares) {
        centre_ = Vec3d::Zero();
        for (const Vec3f& p : body.points) centre_ += p.cast<double>() / double(body.points.size());
        std::vector<Vec3d> planes;  // n / d
        for (const Triangle& t : body.triangles) {
            const Vec3d a = body.points[t[0]].cast<double>() - centre_;
            const Vec3d normal = (body.points[t[1]].cast<double>() - centre_ - a)
                                     .cross(body.points[t[2]].cast<double>() - centre_ - a);
            if (normal.dot(a) > 0) planes.emplace_back(normal / normal.dot(a));
        }
        const auto count = static_cast<std::size_t>(squares), side = count + 1;
        std::vector<double> corner(6 * side * side, 0);
        parallel_for(corner.size(), 64, [&](std::size_t i) {
            const int axis = static_cast<int>(i / (2 * side * side));
            Vec3d ray;
            ray[axis] = i / (side * side) % 2 ? 1 : -1;
            ray[(axis + 1) % 3] = -1 + 2.0 * static_cast<double>(i % side) / squares;
            ray[(axis + 2) % 3] = -1 + 2.0 * static_cast<double>(i / side % side) / squares;
            for (const Vec3d& plane : planes) corner[i] = std::max(corner[i], plane.dot(ray));
        });
        steepest_.resize(6 * count * count);
        for (std::size_t i = 0; i < steepest_.size(); ++i) {
            const std::size_t face = i / (count * count), y = i / count % count, x = i % count;
            const double* c = corner.data() + (face * side + y) * side + x;
            steepest_[i] = std::max({c[0], c[1], c[side], c[side + 1]});
        }
    }

    bool operator()(const Vec3f& p) const {
        constexpr double margin = 1 - 1e-6;
        const Vec3d d = p.cast<double>() - centre_;
        Eigen::Index axis = 0;
        const double t = d.cwiseAbs().maxCoeff(&axis);
        if (!(t > 0)) return true;
        const auto square = [&](Eigen::Index a) {
            const int at = static_cast<int>((d[a % 3] / t + 1) * (0.5 * squares_));
            return static_cast<std::size_t>(std::min(at, squares_ - 1));
        };
        const auto face = static_cast<std::size_t>(2 * axis + (d[axis] > 0));
        return t * steepest_[(face * std::size_t(squares_) + square(axis + 2)) * std::size_t(squares_) +
                             square(axis + 1)] <
               margin;
    }

 private:
    int squares_;  ///< along a side of the cube
    Vec3d centre_;
    std::vector<double> steepest_;  ///< the largest 1/t of each square
};

/// The points that are not inside the hull of `some` of them.
Array<Vec3f> outside(const Array<Vec3f>& points, Array<Vec3f> some) {
    sort_unique(some);
    const TriMesh body = quickhull(some);
    if (body.empty()) return points;
    const Inside inside(body, points.size() > many ? 128 : 32);
    const std::size_t blocks = (points.size() + grain - 1) / grain;
    std::vector<std::vector<Vec3f>> kept(blocks);
    parallel_blocks(points.size(), grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            if (!inside(points[i])) kept[begin / grain].push_back(points[i]);
    });
    Array<Vec3f> all;
    for (const auto& part : kept) all.insert(all.end(), part.begin(), part.end());
    return all;
}

Array<Vec3f> picked(const Array<Vec3f>& points, const std::vector<std::size_t>& which) {
    Array<Vec3f> some;
    for (const std::size_t i : which) some.push_back(points[i]);
    return some;
}

}  // namespace

bool have_convex_hull() { return true; }

TriMesh convex_hull(const Array<Vec3f>& points) {
    for (std::size_t i = 0; i < points.size(); ++i)
        if (!points[i].allFinite()) throw InvalidInput(fmt::format("convex hull: point {} is not finite", i));
    Array<Vec3f> left = points;
    // The second round starts from what the first left, and so from points near the hull all over.
    for (const int count : {200, 2000}) {
        if (left.size() < few) break;
        const std::size_t stride = std::max<std::size_t>(1, left.size() / 20000);
        std::vector<std::size_t> some = extremes(left, directions(count), stride);
        const auto more = extremes(left, directions(16), 1);
        some.insert(some.end(), more.begin(), more.end());
        left = outside(left, picked(left, some));
    }
    sort_unique(left);
    TriMesh hull = quickhull(left);
    if (hull.empty())
        throw InvalidInput(fmt::format("convex hull: {} points without a volume", points.size()));
    return hull;
}

}  // namespace vdbgeo

#else

namespace vdbgeo {

bool have_convex_hull() { return false; }

TriMesh convex_hull(const Array<Vec3f>&) {
    throw InvalidInput("finding the convex hull needs CGAL, which this build does not have");
}

}  // namespace vdbgeo

#endif
