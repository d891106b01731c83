#include "vdbgeo/measure/geodesic_disc.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace vdbgeo {

GeodesicDisc::GeodesicDisc(const TriMesh& mesh, const VertexFaces& faces)
    : mesh_(mesh), faces_(faces), stamp_(mesh.points.size(), 0), distance_(mesh.points.size()) {
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (caps && caps->components == 1) caps_ = caps->values.data();
}

const std::vector<GeodesicDisc::Member>& GeodesicDisc::find(VertexId v, double radius) {
    now_ += 2;
    if (now_ == 0) {  // after 2^31 discs the old stamps would come up again
        std::fill(stamp_.begin(), stamp_.end(), 0);
        now_ = 2;
    }
    members_.clear();
    heap_.clear();
    offer(v, 0);
    while (!heap_.empty()) {
        const auto [distance, from] = heap_.front();
        std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
        heap_.pop_back();
        if (settled(from)) continue;  // by a shorter way
        if (distance > radius) break;
        ++stamp_[from];
        members_.push_back({from, distance});
        spread(from);
    }
    // Over a face that is obtuse towards it the front can come to what is nearer than where it stands.
    const auto nearer = [](const Member& a, const Member& b) {
        return a.distance != b.distance ? a.distance < b.distance : a.vertex < b.vertex;
    };
    if (!std::is_sorted(members_.begin() + 1, members_.end(), nearer))
        std::sort(members_.begin() + 1, members_.end(), nearer);
    return members_;
}

void GeodesicDisc::offer(VertexId v, double distance) {
    if (known(v) && distance_[v] <= distance) return;
    stamp_[v] = now_;
    distance_[v] = distance;
    heap_.emplace_back(distance, v);
    std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
}

void GeodesicDisc::spread(VertexId from) {
    const Vec3d here = mesh_.points[from].cast<double>();
    for (const std::uint32_t *f = faces_.begin(from), *last = faces_.end(from); f != last; ++f) {
        if (is_cap(*f)) continue;
        const Triangle& t = mesh_.triangles[*f];
        const std::size_t k = corner_of(t, from);
        const VertexId a = t[(k + 1) % 3], b = t[(k + 2) % 3];
        const bool a_open = !settled(a);
        const bool b_open = !settled(b);
        if (!a_open && !b_open) continue;
        const Vec3d to_a = mesh_.points[a].cast<double>() - here;
        const Vec3d to_b = mesh_.points[b].cast<double>() - here;
        const double length_a = to_a.norm(), length_b = to_b.norm();
        if (a_open) offer(a, across(from, b, {length_b, length_a, to_a.dot(to_b)}));
        if (b_open) offer(b, across(from, a, {length_a, length_b, to_a.dot(to_b)}));
    }
}

/// Unfolds a face: `from` is the origin, `beside` lies on the positive x axis, the third corner above it, and
/// what the two distances are measured from below it.
double GeodesicDisc::across(VertexId from, VertexId beside, const Corner& face) const {
    const double near = distance_[from], along = near + face.third;
    if (near == 0 || !known(beside) || !(face.beside > 0)) return along;
    const double other = distance_[beside], length = face.beside;
    const double source_x = (near * near - other * other + length * length) / (2 * length);
    const double source_y2 = near * near - source_x * source_x;
    if (!(source_y2 > 0)) return along;
    const double to_x = face.product / length;
    const double to_y = std::sqrt(std::max(0.0, face.third * face.third - to_x * to_x));
    const double source_y = std::sqrt(source_y2), height = source_y + to_y;
    const double crossing = source_x * height + (to_x - source_x) * source_y;
    if (crossing < 0 || crossing > length * height) return along;
    return std::sqrt((to_x - source_x) * (to_x - source_x) + height * height);
}

}  // namespace vdbgeo
