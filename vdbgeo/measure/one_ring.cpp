#include "vdbgeo/measure/one_ring.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 14;
/// Spacing of floats over mean edge above which a mesh's shape is lost in rounding.
constexpr double coarsest_rounding = 0.01;

double spacing_at(double coordinate) {
    const float c = static_cast<float>(coordinate);
    return std::nextafter(c, std::numeric_limits<float>::infinity()) - c;
}

struct EdgeSums {
    double length = 0, largest = 0;

    double spacing() const { return spacing_at(largest); }
};

/// Over every `stride`th face.
EdgeSums sum_edges(const TriMesh& mesh, std::size_t stride) {
    return fixed_order_reduce((mesh.triangles.size() + stride - 1) / stride, grain, EdgeSums{},
                              [&](std::size_t begin, std::size_t end) {
                                  EdgeSums s;
                                  for (std::size_t f = begin; f < end; ++f) {
                                      const Triangle& t = mesh.triangles[f * stride];
                                      for (std::size_t k = 0; k < 3; ++k) {
                                          const Vec3d a = mesh.points[t[k]].cast<double>();
                                          s.length += (mesh.points[t[(k + 1) % 3]].cast<double>() - a).norm();
                                          s.largest = std::max(s.largest, a.cwiseAbs().maxCoeff());
                                      }
                                  }
                                  return s;
                              },
                              [](EdgeSums& to, const EdgeSums& part) {
                                  to.length += part.length;
                                  to.largest = std::max(to.largest, part.largest);
                              });
}

double largest_coordinate(const TriMesh& mesh) {
    return fixed_order_reduce(
        mesh.points.size(), grain, 0.0,
        [&](std::size_t begin, std::size_t end) {
            float largest = 0;
            for (std::size_t v = begin; v < end; ++v)
                largest = std::max(largest, mesh.points[v].cwiseAbs().maxCoeff());
            return static_cast<double>(largest);
        },
        [](double& to, double part) { to = std::max(to, part); });
}

}  // namespace

OneRing::OneRing(const TriMesh& mesh, const VertexFaces& faces) : mesh_(mesh), faces_(faces) {
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (caps && caps->components == 1) caps_ = caps->values.data();
}

void OneRing::fill(VertexId v) {
    vertex_ = v;
    const std::uint32_t *first = faces_.begin(v), *last = faces_.end(v);
    const std::size_t count = static_cast<std::size_t>(last - first);
    any_ = count > 0;
    if (count > out_.size())
        for (auto* array : {&out_, &in_, &face_}) array->resize(2 * count);
    size_ = 0;
    for (const std::uint32_t* f = first; f != last; ++f) {
        if (caps_ && caps_[*f] > 0.5f) continue;
        const Triangle& t = mesh_.triangles[*f];
        const std::size_t k = corner_of(t, v);
        out_[size_] = t[k == 2 ? 0 : k + 1];
        in_[size_] = t[k == 0 ? 2 : k - 1];
        face_[size_++] = *f;
    }
}

bool OneRing::has_area() const {
    const Vec3d p = mesh_.points[vertex_].cast<double>();
    for (std::size_t k = 0; k < size_; ++k)
        if ((mesh_.points[out_[k]].cast<double>() - p).cross(mesh_.points[in_[k]].cast<double>() - p).norm() >
            0)
            return true;
    return false;
}

/// Walks once round an ordinary fan: every neighbour is left once and met once, but for the ends of an open
/// one.
OneRing::Fan OneRing::fan() const {
    constexpr std::size_t most = 32;
    if (size_ == 0 || size_ > most) return Fan::other;
    std::uint8_t next[most];
    std::uint32_t met = 0;
    int ends = 0;
    for (std::size_t k = 0; k < size_; ++k) {
        std::uint32_t follows = 0;
        for (std::size_t j = 0; j < size_; ++j) follows |= std::uint32_t{out_[j] == in_[k]} << j;
        if (follows & ((follows - 1) | met)) return Fan::other;
        met |= follows;
        ends += follows == 0;
        next[k] = static_cast<std::uint8_t>(follows ? __builtin_ctz(follows) : most);
    }
    if (ends > 1) return Fan::other;
    const std::size_t start = ends ? static_cast<std::size_t>(__builtin_ctz(~met)) : 0;
    std::size_t walked = 0, k = start;
    do k = next[k], ++walked;
    while (k != most && k != start);
    return walked < size_ ? Fan::other : ends ? Fan::open : Fan::closed;
}

std::uint8_t OneRing::flags(bool area, std::uint64_t& misoriented) {
    if (only_caps()) return curvature_cap | curvature_undefined;
    std::uint8_t flags = area ? 0 : curvature_undefined;
    switch (fan()) {
        case Fan::closed:
            return flags;
        case Fan::open:
            return flags | curvature_border;
        case Fan::other:
            break;
    }
    return flags | flags_of_star(misoriented);
}

std::uint8_t OneRing::flags_of_star(std::uint64_t& misoriented) {
    star_.fill(mesh_, faces_, vertex_);
    const auto is_cap = [&](std::uint32_t slot) { return caps_ && caps_[star_.face(slot)] > 0.5f; };
    bool border = false, bad = false, turned = false;
    star_.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
        const VertexStar::Spoke* faces[2];
        int count = 0;
        for (const VertexStar::Spoke* s = first; s != last; ++s)
            if (!is_cap(s->slot)) {
                if (count < 2) faces[count] = s;
                ++count;
            }
        border |= count == 1;
        bad |= count > 2;
        if (count == 2) {
            turned |= faces[0]->out == faces[1]->out;
            star_.join(faces[0]->slot, faces[1]->slot);
        }
    });
    misoriented += turned;
    std::uint32_t fans = 0;
    for (std::uint32_t s = 0; s < star_.face_count(); ++s) fans += !is_cap(s) && star_.fan(s) == s;
    return static_cast<std::uint8_t>((border ? curvature_border : 0) |
                                     (bad || fans != 1 ? curvature_undefined : 0));
}

void check_curvature_input(const TriMesh& mesh, const char* stage) {
    check(mesh, stage);
    if (mesh.empty()) return;
    const double corners = 3 * static_cast<double>(mesh.triangles.size());
    // The edges of some faces make up a part of the mean, and mostly that is enough.
    constexpr std::size_t stride = 16;
    if (spacing_at(largest_coordinate(mesh)) <= coarsest_rounding * sum_edges(mesh, stride).length / corners)
        return;
    const EdgeSums sums = sum_edges(mesh, 1);
    const double edge = sums.length / corners;
    // Points that all coincide have no shape either, but not for their coordinates.
    if (edge > 0 && sums.spacing() > coarsest_rounding * edge)
        throw InvalidInput(fmt::format(
            "{}: coordinates up to {:.6g} Å are rounded to {:.2g} Å, and edges are {:.3g} Å long on average: "
            "too coarse for curvature; move the mesh to the origin before it is written",
            stage, sums.largest, sums.spacing(), edge));
}

double mean_edge(const TriMesh& mesh) {
    return mesh.empty() ? 0 : sum_edges(mesh, 1).length / (3 * static_cast<double>(mesh.triangles.size()));
}

void check_oriented(std::uint64_t misoriented, const char* stage) {
    if (misoriented > 0)
        throw InvalidInput(fmt::format(
            "{}: the sign of curvature needs faces that are turned the same way, but at {} vertices two run "
            "through an edge in the same direction; try repair (a Möbius strip has no outside)",
            stage, misoriented));
}

}  // namespace vdbgeo
