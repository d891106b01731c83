#include "vdbgeo/surface/mesh_solid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vdbgeo {

MeshSolid::MeshSolid(std::vector<Vec3d> points, const Array<Triangle>& triangles)
    : points_(std::move(points)), triangles_(triangles) {
    low_ = Vec3d::Constant(std::numeric_limits<double>::infinity());
    high_ = -low_;
    for (const Vec3d& p : points_) {
        low_ = low_.cwiseMin(p);
        high_ = high_.cwiseMax(p);
    }
    // As many squares as faces: a few faces lie over each, whatever the mesh.
    const Vec3d size = high_ - low_;
    const double faces = static_cast<double>(triangles.size());
    side_ = std::max({std::sqrt(size.x() * size.y() / faces), size.x() / faces, size.y() / faces, 1e-30});
    columns_ = static_cast<std::size_t>(size.x() / side_) + 1;
    rows_ = static_cast<std::size_t>(size.y() / side_) + 1;
    first_.assign(columns_ * rows_ + 1, 0);
    const auto for_each_square = [&](const Triangle& t, const auto& visit) {
        const Vec3d &a = points_[t[0]], &b = points_[t[1]], &c = points_[t[2]];
        const Vec3d from = a.cwiseMin(b).cwiseMin(c), to = a.cwiseMax(b).cwiseMax(c);
        for (std::size_t i = square(from.x(), 0); i <= square(to.x(), 0); ++i)
            for (std::size_t j = square(from.y(), 1); j <= square(to.y(), 1); ++j) visit(i * rows_ + j);
    };
    for (const Triangle& t : triangles_) for_each_square(t, [&](std::size_t s) { ++first_[s + 1]; });
    for (std::size_t s = 1; s < first_.size(); ++s) first_[s] += first_[s - 1];
    faces_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::uint32_t f = 0; f < triangles_.size(); ++f)
        for_each_square(triangles_[f], [&](std::size_t s) { faces_[next[s]++] = f; });
}

std::size_t MeshSolid::square(double v, int axis) const {
    const std::size_t count = axis == 0 ? columns_ : rows_;
    const double at = (v - low_[axis]) / side_;
    return at <= 0 ? 0 : std::min(count - 1, static_cast<std::size_t>(at));
}

/// Whether the line up from p goes through the face.
bool MeshSolid::above(const Triangle& t, const Vec3d& p) const {
    const auto left = [&](VertexId from, VertexId to) {
        const bool turned = from > to;
        const Vec3d &a = points_[turned ? to : from], &b = points_[turned ? from : to];
        double side = (b.x() - a.x()) * (p.y() - a.y()) - (b.y() - a.y()) * (p.x() - a.x());
        if (side == 0) side = a.y() - b.y();
        if (side == 0) side = b.x() - a.x();
        return (side >= 0) != turned;
    };
    const bool first = left(t[0], t[1]);
    if (left(t[1], t[2]) != first || left(t[2], t[0]) != first) return false;
    const Vec3d& a = points_[t[0]];
    const Vec3d n = (points_[t[1]] - a).cross(points_[t[2]] - a);
    if (n.z() == 0) return a.z() > p.z();
    return n.dot(p - a) * n.z() < 0;
}

double MeshSolid::operator()(const Vec3d& p) const {
    constexpr double far = std::numeric_limits<double>::infinity();
    for (int a = 0; a < 3; ++a)
        if (!(p[a] >= low_[a] && p[a] <= high_[a])) return -far;
    const std::size_t s = square(p.x(), 0) * rows_ + square(p.y(), 1);
    bool inside = false;
    for (std::size_t k = first_[s]; k < first_[s + 1]; ++k)
        if (above(triangles_[faces_[k]], p)) inside = !inside;
    return inside ? far : -far;
}

}  // namespace vdbgeo
