#include "vdbgeo/measure/mesh_measures.h"

#include <fmt/format.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "vdbgeo/core/disjoint_sets.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 14;
constexpr double degrees = 180 / 3.14159265358979323846;

constexpr double first_ratio = 0.5, ratio_bins_per_unit = 20;

struct Sums {
    double area = 0, cap_area = 0, volume = 0, angles = 0, min_angle = 180, max_angle = 0;
    double ratios = 0, max_ratio = 0;
    std::uint64_t flat_faces = 0;
    std::array<std::uint64_t, 180> histogram{};
    std::array<std::uint64_t, 40> ratio_histogram{};
};

/// Faces one behind the other, and the points of their corners wherever they are.
template <class PointAt>
struct Faces {
    const Triangle* triangles;
    std::size_t count;
    PointAt point;
    std::function<bool(std::size_t)> cap;
};

/// Adds up the faces' corners: points that no face uses may lie anywhere.
template <class PointAt>
Vec3d sum_corners(const Faces<PointAt>& faces, const Vec3d& before) {
    return fixed_order_reduce(
        faces.count, block, before,
        [&](std::size_t begin, std::size_t end) {
            Vec3d s = Vec3d::Zero();
            for (std::size_t f = begin; f < end; ++f)
                for (const VertexId v : faces.triangles[f]) s += faces.point(v).template cast<double>();
            return s;
        },
        [](Vec3d& all, const Vec3d& part) { all += part; });
}

void add_angle(Sums& sums, double angle) {
    sums.angles += angle;
    sums.min_angle = std::min(sums.min_angle, angle);
    sums.max_angle = std::max(sums.max_angle, angle);
    ++sums.histogram[static_cast<std::size_t>(std::min(179.0, angle))];
}

void add_ratio(Sums& sums, double ratio) {
    sums.ratios += ratio;
    sums.max_ratio = std::max(sums.max_ratio, ratio);
    const double last = static_cast<double>(sums.ratio_histogram.size() - 1);
    ++sums.ratio_histogram[static_cast<std::size_t>(
        std::clamp((ratio - first_ratio) * ratio_bins_per_unit, 0.0, last))];
}

void add_face(Sums& sums, const std::array<Vec3d, 3>& p, const Vec3d& centre, bool cap) {
    // Differences of floats are exact in double; those of centred points are not, and needles would show it.
    const Vec3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    const double twice_area = normal.norm();
    (cap ? sums.cap_area : sums.area) += 0.5 * twice_area;
    sums.volume += (p[0] - centre).dot(normal) / 6;
    if (twice_area == 0) {
        for (const double angle : {0.0, 0.0, 180.0}) add_angle(sums, angle);
        ++sums.flat_faces;
        ++sums.ratio_histogram.back();
        return;
    }
    std::array<double, 3> squared;  // of the side across each corner
    for (std::size_t k = 0; k < 3; ++k) squared[k] = (p[(k + 2) % 3] - p[(k + 1) % 3]).squaredNorm();
    const auto widest =
        static_cast<std::size_t>(std::max_element(squared.begin(), squared.end()) - squared.begin());
    double rest = 180;  // the widest angle is what the sharp ones, which are exact, leave
    for (std::size_t k = 0; k < 3; ++k) {
        if (k == widest) continue;
        const double angle =
            degrees * std::atan2(twice_area, (p[(k + 1) % 3] - p[k]).dot(p[(k + 2) % 3] - p[k]));
        add_angle(sums, angle);
        rest -= angle;
    }
    add_angle(sums, rest);
    std::sort(squared.begin(), squared.end());
    add_ratio(sums, std::sqrt(squared[1]) * std::sqrt(squared[2]) / (2 * twice_area));
}

void join_sums(Sums& all, const Sums& part) {
    all.area += part.area;
    all.cap_area += part.cap_area;
    all.ratios += part.ratios;
    all.max_ratio = std::max(all.max_ratio, part.max_ratio);
    all.flat_faces += part.flat_faces;
    for (std::size_t k = 0; k < all.ratio_histogram.size(); ++k)
        all.ratio_histogram[k] += part.ratio_histogram[k];
    all.volume += part.volume;
    all.angles += part.angles;
    all.min_angle = std::min(all.min_angle, part.min_angle);
    all.max_angle = std::max(all.max_angle, part.max_angle);
    for (std::size_t k = 0; k < all.histogram.size(); ++k) all.histogram[k] += part.histogram[k];
}

template <class PointAt>
Sums sum_faces(const Faces<PointAt>& faces, const Vec3d& centre, const Sums& before) {
    return fixed_order_reduce(
        faces.count, block, before,
        [&](std::size_t begin, std::size_t end) {
            Sums s;
            for (std::size_t f = begin; f < end; ++f) {
                std::array<Vec3d, 3> p;
                for (std::size_t k = 0; k < 3; ++k)
                    p[k] = faces.point(faces.triangles[f][k]).template cast<double>();
                add_face(s, p, centre, faces.cap && faces.cap(f));
            }
            return s;
        },
        join_sums);
}

/// One end of a boundary edge.
struct BorderEnd {
    VertexId vertex, other;
    std::uint32_t fan;  // of the vertex
};

struct Counts {
    std::uint64_t used = 0, edges = 0, boundary = 0, non_manifold = 0, misoriented = 0, duplicates = 0,
                  split_vertices = 0;
    std::vector<BorderEnd> border;
};

/// How many faces of an edge have the same third vertex as one before them, where that is the face's highest
/// vertex: so each face is looked at at one of its edges.
std::uint64_t duplicates_at(const TriMesh& mesh, const VertexStar& star, const VertexStar::Spoke* first,
                            const VertexStar::Spoke* last) {
    const VertexId v = star.vertex(), other = first->other;
    if (last - first < 2 || v > other) return 0;
    const auto apex = [&](const VertexStar::Spoke& s) {
        const Triangle& t = mesh.triangles[star.face(s.slot)];
        return t[(corner_of(t, v) + (s.out ? 2u : 1u)) % 3];
    };
    if (last - first == 2) return apex(first[0]) == apex(first[1]) && apex(first[0]) > other;
    std::vector<VertexId> tops;
    for (const VertexStar::Spoke* s = first; s != last; ++s)
        if (apex(*s) > other) tops.push_back(apex(*s));
    std::sort(tops.begin(), tops.end());
    return static_cast<std::uint64_t>(tops.end() - std::unique(tops.begin(), tops.end()));
}

void count_star(const TriMesh& mesh, VertexStar& star, Counts& counts) {
    const VertexId v = star.vertex();
    ++counts.used;
    bool border = false;
    star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
        const auto faces = last - first;
        border |= faces == 1;
        for (const VertexStar::Spoke* s = first + 1; s < last; ++s) star.join(first->slot, s->slot);
        if (v > first->other) return;
        ++counts.edges;
        counts.boundary += faces == 1;
        counts.non_manifold += faces > 2;
        counts.misoriented += faces == 2 && first[0].out == first[1].out;
        counts.duplicates += duplicates_at(mesh, star, first, last);
    });
    counts.split_vertices += star.fan_count() > 1;
    if (!border) return;
    star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
        if (last - first == 1) counts.border.push_back({v, first->other, star.fan(first->slot)});
    });
}

void join_counts(Counts& all, const Counts& part) {
    all.used += part.used;
    all.edges += part.edges;
    all.boundary += part.boundary;
    all.non_manifold += part.non_manifold;
    all.misoriented += part.misoriented;
    all.duplicates += part.duplicates;
    all.split_vertices += part.split_vertices;
    all.border.insert(all.border.end(), part.border.begin(), part.border.end());
}

/// Of the vertices [first, last).
Counts count_stars(const TriMesh& mesh, std::size_t first, std::size_t last) {
    const VertexFaces faces(mesh);
    return fixed_order_reduce(
        last - first, block, Counts{},
        [&](std::size_t begin, std::size_t end) {
            Counts counts;
            VertexStar star;
            for (std::size_t v = first + begin; v < first + end; ++v) {
                star.fill(mesh, faces, static_cast<VertexId>(v));
                if (star.face_count() > 0) count_star(mesh, star, counts);
            }
            return counts;
        },
        join_counts);
}

/// The ends come vertex by vertex. Those of one edge belong together, and those in one fan of a vertex.
std::uint64_t count_loops(const std::vector<BorderEnd>& ends) {
    if (ends.size() >= std::numeric_limits<std::uint32_t>::max())
        throw NumericalError("the mesh has more border edges than can be counted, 2^31");
    DisjointSets loops(ends.size());
    std::vector<std::uint32_t> order(ends.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto join_equal = [&](const auto& key) {
        std::sort(order.begin(), order.end(),
                  [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
        for (std::size_t i = 1; i < order.size(); ++i)
            if (key(order[i]) == key(order[i - 1])) loops.join(order[i], order[i - 1]);
    };
    join_equal([&](std::uint32_t i) { return std::minmax(ends[i].vertex, ends[i].other); });
    join_equal([&](std::uint32_t i) { return std::make_pair(ends[i].vertex, ends[i].fan); });
    std::uint64_t count = 0;
    for (std::uint32_t i = 0; i < ends.size(); ++i) count += loops.find(i) == i;
    return count;
}

/// How faces join vertices to pieces.
struct Pieces {
    DisjointSets sets;
    std::uint64_t joints = 0;  // each takes one piece away
    std::uint64_t degenerate_faces = 0;

    explicit Pieces(std::size_t vertices) : sets(vertices) {}
    void add(const Triangle& t) {
        degenerate_faces += degenerate(t);
        if (degenerate(t)) return;
        for (const VertexId other : {t[1], t[2]}) {
            if (sets.find(t[0]) == sets.find(other)) continue;
            sets.join(t[0], other);
            ++joints;
        }
    }
};

void take_topology(const Counts& counts, const Pieces& pieces, MeshMeasures& m) {
    m.edges = counts.edges;
    m.boundary_edges = counts.boundary;
    m.non_manifold_edges = counts.non_manifold;
    m.misoriented_edges = counts.misoriented;
    m.duplicate_faces = counts.duplicates;
    m.non_manifold_vertices = counts.split_vertices;
    m.holes = count_loops(counts.border);
    m.unused_vertices = m.vertices - counts.used;
    m.degenerate_faces = pieces.degenerate_faces;
    m.components = counts.used - pieces.joints;
    m.euler_characteristic = static_cast<std::int64_t>(counts.used) - static_cast<std::int64_t>(m.edges) +
                             static_cast<std::int64_t>(m.faces - m.degenerate_faces);
    m.closed = m.faces > m.degenerate_faces && m.boundary_edges == 0 && m.non_manifold_edges == 0;
    m.oriented = m.misoriented_edges == 0;
    m.manifold = m.non_manifold_edges == 0 && m.non_manifold_vertices == 0 && m.degenerate_faces == 0;
    if (m.closed && m.manifold && m.oriented)
        m.genus = (2 * static_cast<std::int64_t>(m.components) - m.euler_characteristic) / 2;
}

void take_sums(const Sums& sums, MeshMeasures& m) {
    m.area_A2 = sums.area;
    m.cap_area_A2 = sums.cap_area;
    if (m.closed && m.oriented) m.volume_A3 = sums.volume;
    m.min_angle_deg = sums.min_angle;
    m.max_angle_deg = sums.max_angle;
    m.mean_angle_deg = sums.angles / (3 * static_cast<double>(m.faces));
    m.angle_histogram = sums.histogram;
    m.angles_below_30_fraction = static_cast<double>(std::accumulate(
                                     sums.histogram.begin(), sums.histogram.begin() + 30, std::uint64_t(0))) /
                                 (3 * static_cast<double>(m.faces));
    m.radius_edge_max = sums.max_ratio;
    if (m.faces > sums.flat_faces)
        m.radius_edge_mean = sums.ratios / static_cast<double>(m.faces - sums.flat_faces);
    m.radius_edge_histogram = sums.ratio_histogram;
}

/// Goes through a mesh that is stored somewhere.
class StoredMeasure {
    /// What was read last.
    auto faces(std::size_t count) const {
        const auto point = [this](VertexId v) { return mesh_.point(v); };
        return Faces<decltype(point)>{triangles_.data(), count, point,
                                      [this](std::size_t f) { return caps_[f] != 0; }};
    }

 public:
    StoredMeasure(const StoredMesh& mesh, std::uint64_t memory, const Progress& progress)
        : mesh_(mesh), memory_(memory), progress_(progress), triangles_(batch), caps_(batch) {}

    MeshMeasures run() {
        MeshMeasures m;
        m.vertices = mesh_.vertices();
        m.faces = mesh_.faces();
        const Vec3d centre = check_and_find_centre();
        Sums sums;
        for_batches(0.2, [&](std::size_t count) { sums = sum_faces(faces(count), centre, sums); });
        mesh_.release();
        const std::uint64_t held = 4 * m.vertices + 50000000;
        if (memory_ <= held) throw does_not_fit();
        const std::uint64_t left = memory_ - held;
        Pieces pieces(m.vertices);
        for_batches(0.3, [&](std::size_t count) {
            for (std::size_t f = 0; f < count; ++f) pieces.add(triangles_[f]);
        });
        const std::vector<Range> ranges = ranges_of(left / 4 * 3 / bytes_a_face);
        Counts counts;
        for (std::size_t r = 0; r < ranges.size(); ++r) {
            add_range(ranges[r], 0.4 + 0.6 * double(r + 1) / double(ranges.size()), counts);
            if (counts.border.size() > left / 4 / bytes_an_end) throw does_not_fit();
        }
        take_topology(counts, pieces, m);
        if (m.faces > 0) take_sums(sums, m);
        progress_.report(1);
        return m;
    }

 private:
    static constexpr std::size_t batch = 64 * block;  // faces
    static constexpr std::uint64_t bytes_a_face = 80;
    static constexpr std::uint64_t bytes_an_end = 36;  // BorderEnd, of which a list that grows has three

    static NumericalError does_not_fit() {
        return NumericalError("the mesh does not fit into the memory that may be taken, nor parts of it");
    }
    /// Vertices [first, last), and how many faces touch them at most.
    struct Range {
        VertexId first, last;
        std::uint64_t faces;
    };

    /// Reads the faces batch by batch; `until`: how far all is when they are through.
    template <class Body>
    void for_batches(double until, const Body& body) {
        const double from = done_;
        for (std::uint64_t first = 0; first < mesh_.faces(); first += batch) {
            const auto count =
                static_cast<std::size_t>(std::min<std::uint64_t>(batch, mesh_.faces() - first));
            first_ = first;
            mesh_.read_faces(first, count, triangles_.data(), caps_.data());
            body(count);
            mesh_.release();
            done_ = from + (until - from) * double(first + count) / double(mesh_.faces());
            progress_.report(done_);
        }
    }
    Vec3d check_and_find_centre() {
        const std::uint64_t vertices = mesh_.vertices();
        for (std::uint64_t begin = 0; begin < vertices; begin += batch, mesh_.release())
            for (std::uint64_t v = begin; v < std::min<std::uint64_t>(vertices, begin + batch); ++v)
                if (!mesh_.point(static_cast<VertexId>(v)).allFinite())
                    throw InvalidInput(
                        fmt::format("mesh: vertex {} has a coordinate that is not a finite number", v));
        Vec3d sum = Vec3d::Zero();
        for_batches(0.1, [&](std::size_t count) {
            for (std::size_t f = 0; f < count; ++f)
                for (const VertexId v : triangles_[f])
                    if (v >= vertices)
                        throw InvalidInput(
                            fmt::format("mesh: face {} names vertex {} of {}", first_ + f, v, vertices));
            sum = sum_corners(faces(count), sum);
        });
        return sum / (3 * static_cast<double>(mesh_.faces()));
    }
    /// Ranges of vertices that at most so many faces touch.
    std::vector<Range> ranges_of(std::uint64_t most) {
        most = std::min<std::uint64_t>(most, std::numeric_limits<std::uint32_t>::max() - 1);
        constexpr std::uint64_t bins = 1 << 16;
        const std::uint64_t wide = mesh_.vertices() / bins + 1;
        std::vector<std::uint64_t> faces_of(bins, 0);
        for_batches(0.4, [&](std::size_t count) {
            for (std::size_t f = 0; f < count; ++f) {
                const Triangle& t = triangles_[f];
                const std::uint64_t b[3] = {t[0] / wide, t[1] / wide, t[2] / wide};
                ++faces_of[b[0]];
                if (b[1] != b[0]) ++faces_of[b[1]];
                if (b[2] != b[0] && b[2] != b[1]) ++faces_of[b[2]];
            }
        });
        std::vector<Range> ranges{{0, 0, 0}};
        for (std::uint64_t b = 0; b * wide < mesh_.vertices(); ++b) {
            if (faces_of[b] > most) throw does_not_fit();
            const auto first = static_cast<VertexId>(b * wide);
            if (ranges.back().faces + faces_of[b] > most) ranges.push_back({first, first, 0});
            ranges.back().last = static_cast<VertexId>(std::min(mesh_.vertices(), first + wide));
            ranges.back().faces += faces_of[b];
        }
        return ranges;
    }
    /// The faces that touch a range, in a mesh of their own: its vertices are in the order of the whole.
    void add_range(const Range& range, double until, Counts& counts) {
        std::vector<Triangle> touching;
        touching.reserve(range.faces);
        for_batches(until, [&](std::size_t count) {
            for (std::size_t f = 0; f < count; ++f) {
                const Triangle& t = triangles_[f];
                if (std::any_of(t.begin(), t.end(),
                                [&](VertexId v) { return v >= range.first && v < range.last; }))
                    touching.push_back(t);
            }
        });
        std::vector<VertexId> ids;
        ids.reserve(3 * touching.size());
        for (const Triangle& t : touching) ids.insert(ids.end(), t.begin(), t.end());
        tbb::parallel_sort(ids.begin(), ids.end());
        ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
        const auto place = [&](VertexId v) {
            return static_cast<VertexId>(std::lower_bound(ids.begin(), ids.end(), v) - ids.begin());
        };
        TriMesh part;
        part.points.resize(ids.size());
        part.triangles.resize(touching.size());
        parallel_for(touching.size(), 1024, [&](std::size_t f) {
            for (std::size_t k = 0; k < 3; ++k) part.triangles[f][k] = place(touching[f][k]);
        });
        touching = {};
        Counts here = count_stars(part, place(range.first), place(range.last));
        for (BorderEnd& end : here.border) {
            end.vertex = ids[end.vertex];
            end.other = ids[end.other];
        }
        join_counts(counts, here);
    }

    const StoredMesh& mesh_;
    std::uint64_t memory_;
    const Progress& progress_;
    std::vector<Triangle> triangles_;
    std::vector<char> caps_;
    std::uint64_t first_ = 0;
    double done_ = 0;
};

}  // namespace

MeshMeasures measure_mesh(const TriMesh& mesh, const Progress& progress) {
    check(mesh, "mesh");
    MeshMeasures m;
    m.vertices = mesh.points.size();
    m.faces = mesh.triangles.size();
    Pieces pieces(mesh.points.size());
    for (const Triangle& t : mesh.triangles) pieces.add(t);
    take_topology(count_stars(mesh, 0, mesh.points.size()), pieces, m);
    progress.report(0.8);
    if (m.faces == 0) return m;
    const auto point = [&](VertexId v) -> const Vec3f& { return mesh.points[v]; };
    Faces<decltype(point)> faces{mesh.triangles.data(), mesh.triangles.size(), point, {}};
    if (const MeshProperty* caps = mesh.find_face_property(cap_property))
        faces.cap = [caps](std::size_t f) {
            return caps->values[f * static_cast<std::size_t>(caps->components)] > 0.5f;
        };
    const Vec3d centre =
        sum_corners(faces, Vec3d(Vec3d::Zero())) / (3 * static_cast<double>(mesh.triangles.size()));
    take_sums(sum_faces(faces, centre, Sums{}), m);
    progress.report(1);
    return m;
}

MeshMeasures measure_mesh(const StoredMesh& mesh, std::uint64_t memory, const Progress& progress) {
    return StoredMeasure(mesh, memory, progress).run();
}

}  // namespace vdbgeo
