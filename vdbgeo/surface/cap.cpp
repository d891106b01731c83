#include "vdbgeo/surface/cap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using Accessor = openvdb::tree::ValueAccessor<const openvdb::FloatTree>;

constexpr VertexId none = 0xFFFFFFFFu;
constexpr double nearest = 1.0 / 1024;  // as in marching_cubes: how close to a sample a crossing may lie

struct GridEdge {
    Coord lower;
    int axis = 0;

    bool operator==(const GridEdge& o) const { return lower == o.lower && axis == o.axis; }
};

struct GridEdgeHash {
    std::size_t operator()(const GridEdge& e) const {
        return 3 * std::hash<Coord>()(e.lower) + static_cast<std::size_t>(e.axis);
    }
};

Coord stepped(Coord c, int axis) {
    ++c[axis];
    return c;
}

/// The map as marching_cubes sees it.
class Field {
 public:
    Field(const DensityMap& map, double isovalue)
        : frame_(map.frame), isovalue_(static_cast<float>(isovalue)), accessor_(map.grid->constTree()) {}

    const Frame& frame() const { return frame_; }
    float at(const Coord& c) const { return accessor_.getValue(c); }
    double level(float value) const { return static_cast<double>(value) - isovalue_; }
    bool inside(float value) const { return value >= isovalue_; }
    bool crossed(const GridEdge& e) const {
        return inside(at(e.lower)) != inside(at(stepped(e.lower, e.axis)));
    }

    Vec3d crossing(const GridEdge& e) const {
        const double low = level(at(e.lower)), high = level(at(stepped(e.lower, e.axis)));
        double t = low / (low - high);
        t = t >= 0 && t <= 1 ? std::min(1 - nearest, std::max(nearest, t)) : 0.5;
        Vec3d out(e.lower.x(), e.lower.y(), e.lower.z());
        out[e.axis] += t;
        return out;
    }

 private:
    const Frame frame_;
    const float isovalue_;
    const Accessor accessor_;
};

/// The vertices of the open border of a surface by the grid edges that they lie on.
class OpenBorder {
 public:
    OpenBorder(const TriMesh& mesh, const Field& field)
        : field_(field), to_index_(field.frame().axes.inverse()) {
        for (const VertexId v : open_vertices(mesh)) {
            const Vec3f& p = mesh.points[v];
            match(v, index_of(p), p);
        }
    }

    std::size_t size() const { return at_.size(); }
    VertexId at(const GridEdge& e) const {
        const auto it = at_.find(e);
        if (it == at_.end()) throw_mismatch();
        return it->second;
    }

 private:
    /// Far above the rounding of a position, far below the distance of two samples.
    static constexpr double tolerance = 0.01;

    [[noreturn]] static void throw_mismatch() {
        throw InvalidInput(
            "the border of the surface is not that of the map at this isovalue: caps need the mesh of "
            "marching "
            "cubes, unchanged");
    }

    Vec3d index_of(const Vec3f& p) const { return to_index_ * (p.cast<double>() - field_.frame().origin); }

    bool near_border(const Vec3d& q) const {
        for (int a = 0; a < 3; ++a)
            if (q[a] < tolerance || q[a] > field_.frame().size[a] - 1 - tolerance) return true;
        return false;
    }

    /// Ends of edges that only one triangle has, in order.
    std::vector<VertexId> open_vertices(const TriMesh& mesh) const {
        std::vector<bool> near(mesh.points.size());
        for (std::size_t v = 0; v < near.size(); ++v) near[v] = near_border(index_of(mesh.points[v]));
        std::unordered_set<std::uint64_t> open;
        for (const Triangle& t : mesh.triangles)
            for (std::size_t k = 0; k < 3; ++k) {
                const std::uint64_t a = t[k], b = t[(k + 1) % 3];
                if (!near[a] || !near[b]) continue;
                const std::uint64_t key = std::min(a, b) << 32 | std::max(a, b);
                if (const auto [it, fresh] = open.insert(key); !fresh) open.erase(it);
            }
        std::vector<VertexId> out;
        for (const std::uint64_t key : open) {
            out.push_back(static_cast<VertexId>(key >> 32));
            out.push_back(static_cast<VertexId>(key));
        }
        std::sort(out.begin(), out.end());
        out.erase(std::unique(out.begin(), out.end()), out.end());
        return out;
    }

    bool on_border(const GridEdge& e) const {
        for (int a = 0; a < 3; ++a)
            if (a != e.axis && (e.lower[a] == 0 || e.lower[a] == field_.frame().size[a] - 1)) return true;
        return false;
    }

    /// Takes the crossed edge in the border whose crossing is nearest. Where samples lie at the isovalue
    /// several crossings are a thousandth of a voxel apart; the bits of the positions tell them apart.
    void match(VertexId v, const Vec3d& q, const Vec3f& p) {
        GridEdge best;
        double least = tolerance * tolerance;
        bool found = false;
        for (int axis = 0; axis < 3; ++axis)
            for (const double shift : {-tolerance, tolerance}) {
                GridEdge e{Coord(0), axis};
                bool fits = true;
                for (int a = 0; a < 3; ++a) {
                    const double whole = a == axis ? std::floor(q[a] + shift) : std::round(q[a]);
                    const int last = field_.frame().size[a] - (a == axis ? 2 : 1);
                    fits = fits && whole >= 0 && whole <= last &&
                           (a == axis || std::abs(q[a] - whole) < tolerance);
                    if (fits) e.lower[a] = static_cast<int>(whole);
                }
                if (!fits || !on_border(e) || at_.count(e) || !field_.crossed(e)) continue;
                const Vec3d at = field_.crossing(e);
                const bool same = field_.frame().to_world(at).cast<float>() == p;
                const double distance2 = same ? -1 : (at - q).squaredNorm();
                if (distance2 < least) best = e, least = distance2, found = true;
            }
        if (!found) throw_mismatch();
        at_.emplace(best, v);
    }

    const Field& field_;
    const Mat3d to_index_;
    std::unordered_map<GridEdge, VertexId, GridEdgeHash> at_;
};

/// The corners of a polygon of a cap: a sample or a crossing each.
struct Polygon {
    std::array<VertexId, 6> id;
    std::array<Eigen::Vector2d, 6> place;  // in the plane, in voxels
    std::size_t count = 0;

    void add(VertexId v, const Eigen::Vector2d& at) {
        id[count] = v;
        place[count++] = at;
    }
    double twice_area(std::size_t a, std::size_t b, std::size_t c) const {
        const Eigen::Vector2d u = place[b] - place[a], v = place[c] - place[a];
        return u.x() * v.y() - u.y() * v.x();
    }
    /// The corner from which a fan has the largest least triangle.
    std::size_t apex() const {
        std::size_t best = 0;
        double most = -1;
        for (std::size_t k = 0; k < count; ++k) {
            double least = 1;
            for (std::size_t i = 1; i + 1 < count; ++i)
                least = std::min(least, twice_area(k, (k + i) % count, (k + i + 1) % count));
            if (least > most) most = least, best = k;
        }
        return best;
    }
};

class Capper {
 public:
    Capper(TriMesh& mesh, const Field& field)
        : mesh_(mesh), field_(field), mirrored_(field.frame().axes.determinant() < 0), border_(mesh, field) {}

    void cap_plane(int axis, int side) {
        const Vec3i& size = field_.frame().size;
        axis_ = axis, side_ = side, u_ = (axis + 1) % 3, v_ = (axis + 2) % 3;
        const int n = size[u_];
        values_[1].resize(static_cast<std::size_t>(n));
        ids_[1].resize(static_cast<std::size_t>(n));
        for (int j = 0; j < size[v_]; ++j) {
            values_[0].swap(values_[1]);
            ids_[0].swap(ids_[1]);
            values_[1].resize(static_cast<std::size_t>(n));
            ids_[1].resize(static_cast<std::size_t>(n));
            for (int i = 0; i < n; ++i) {
                const auto at = static_cast<std::size_t>(i);
                const Coord c = sample(i, j);
                values_[1][at] = field_.at(c);
                ids_[1][at] = field_.inside(values_[1][at]) ? vertex(c) : none;
            }
            for (int i = 0; j > 0 && i + 1 < n; ++i) cap_cell(i, j - 1);
        }
    }

 private:
    Coord sample(int i, int j) const {
        Coord c;
        c[axis_] = side_ ? field_.frame().size[axis_] - 1 : 0;
        c[u_] = i;
        c[v_] = j;
        return c;
    }

    /// The vertex at a sample; planes share those at the edges of the box.
    VertexId vertex(const Coord& c) {
        int planes = 0;
        for (int a = 0; a < 3; ++a) planes += c[a] == 0 || c[a] == field_.frame().size[a] - 1;
        VertexId& id = planes > 1 ? shared_.try_emplace(c, none).first->second : fresh_;
        if (planes > 1 && id != none) return id;
        if (mesh_.points.size() >= TriMesh::max_vertices)
            throw InvalidInput("the capped surface has more than 2^32-1 vertices");
        id = static_cast<VertexId>(mesh_.points.size());
        mesh_.points.push_back(field_.frame().to_world(Vec3d(c.x(), c.y(), c.z())).cast<float>());
        return id;
    }

    /// Corners and sides of the cell counter-clockwise seen along −axis; side k runs from corner k.
    static constexpr int step_u[4] = {0, 1, 1, 0}, step_v[4] = {0, 0, 1, 1};

    void cap_cell(int i, int j) {
        std::array<float, 4> value;
        std::array<bool, 4> in;
        for (std::size_t k = 0; k < 4; ++k) {
            value[k] = values_[static_cast<std::size_t>(step_v[k])][static_cast<std::size_t>(i + step_u[k])];
            in[k] = field_.inside(value[k]);
        }
        if (!in[0] && !in[1] && !in[2] && !in[3]) return;
        bool separate = false;
        if (in[0] == in[2] && in[1] == in[3] && in[0] != in[1]) {
            // The asymptotic decider, as cell_topology.cpp has it.
            const double even = field_.level(value[0]) * field_.level(value[2]),
                         odd = field_.level(value[1]) * field_.level(value[3]);
            separate = !(in[0] ? even >= odd : odd >= even);
        }
        Polygon polygon;
        const auto add_crossing = [&](std::size_t k) {
            const std::size_t next = (k + 1) % 4;
            const int axis = k % 2 == 0 ? u_ : v_;
            const GridEdge e{
                sample(i + std::min(step_u[k], step_u[next]), j + std::min(step_v[k], step_v[next])), axis};
            const Vec3d at = field_.crossing(e);
            polygon.add(border_.at(e), {at[u_], at[v_]});
        };
        for (std::size_t k = 0; k < 4; ++k) {
            if (in[k]) {
                if (separate) add_crossing((k + 3) % 4);
                polygon.add(
                    ids_[static_cast<std::size_t>(step_v[k])][static_cast<std::size_t>(i + step_u[k])],
                    {i + step_u[k], j + step_v[k]});
            }
            if (in[k] != in[(k + 1) % 4] && (in[k] || !separate)) add_crossing(k);
            if (in[k] && separate) emit(polygon);
        }
        if (!separate) emit(polygon);
    }

    void emit(Polygon& polygon) {
        const std::size_t apex = polygon.apex(), n = polygon.count;
        for (std::size_t i = 1; i + 1 < n; ++i) {
            Triangle t{polygon.id[apex], polygon.id[(apex + i) % n], polygon.id[(apex + i + 1) % n]};
            if ((side_ == 0) != mirrored_) std::swap(t[1], t[2]);
            mesh_.triangles.push_back(t);
        }
        polygon.count = 0;
    }

    TriMesh& mesh_;
    const Field& field_;
    const bool mirrored_;
    const OpenBorder border_;
    int axis_ = 0, side_ = 0, u_ = 0, v_ = 0;
    std::array<std::vector<float>, 2> values_;  // of two rows of samples
    std::array<std::vector<VertexId>, 2> ids_;  // and their vertices
    std::unordered_map<Coord, VertexId> shared_;
    VertexId fresh_ = none;
};

void extend(std::vector<MeshProperty>& properties, std::size_t elements) {
    for (MeshProperty& p : properties) p.values.resize(elements * static_cast<std::size_t>(p.components));
}

}  // namespace

TriMesh cap_border(TriMesh mesh, const DensityMap& map, double isovalue, const Progress& progress) {
    if (!std::isfinite(static_cast<float>(isovalue)))
        throw InvalidInput("the isovalue is not a finite number");
    if (mesh.find_face_property(cap_property)) throw InvalidInput("the surface has caps already");
    const std::size_t faces = mesh.triangles.size();
    if (map.frame.bounded() && map.frame.size.minCoeff() > 1) {
        const Field field(map, isovalue);
        Capper capper(mesh, field);
        for (int plane = 0; plane < 6; ++plane) {
            capper.cap_plane(plane / 2, plane % 2);
            progress.report((plane + 1) / 6.0);
        }
    }
    extend(mesh.vertex_properties, mesh.points.size());
    extend(mesh.face_properties, mesh.triangles.size());
    MeshProperty caps{cap_property, 1, std::vector<float>(mesh.triangles.size(), 1.0f)};
    std::fill_n(caps.values.begin(), faces, 0.0f);
    mesh.face_properties.push_back(std::move(caps));
    return mesh;
}

}  // namespace vdbgeo
