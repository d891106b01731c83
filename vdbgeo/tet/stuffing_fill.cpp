#include "vdbgeo/tet/stuffing_fill.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/tet/stuffing_stencils.h"

namespace vdbgeo::stuffing {
namespace {

/// Bit k: the face opposite to corner k is on the boundary.
using FaceMask = unsigned;

/// Counts what a block has.
struct Counter {
    static constexpr bool numbers = false;
    std::uint64_t tets = 0, faces = 0;

    void add(const Tetrahedron&, FaceMask boundary) {
        ++tets;
        faces += static_cast<std::uint64_t>(__builtin_popcount(boundary));
    }
};

/// Writes it.
struct Writer {
    static constexpr bool numbers = true;
    Tetrahedron* tets;
    Triangle* faces;

    void add(const Tetrahedron& t, FaceMask boundary) {
        *tets++ = t;
        for (std::size_t k = 0; boundary; ++k, boundary >>= 1)
            if (boundary & 1) {
                for (std::size_t c = 0; c < 3; ++c)
                    (*faces)[c] = t[static_cast<std::size_t>(tet_faces[k][c])];
                ++faces;
            }
    }
};

/// Goes through the tetrahedra of one block: those around the faces that its cells of level 0 have with the
/// next ones up each axis, then those of its cells at larger ones, then those of its larger leaves.
template <class Sink>
class BlockFiller {
 public:
    BlockFiller(const SnappedLattice& points, const Octree& octree, const VertexTable& vertices,
                std::size_t b, Sink& sink)
        : points_(points), octree_(octree), vertices_(vertices), b_(b), sink_(sink) {}

    void run() {
        if (octree_.level_1(b_) != ~std::uint64_t{0}) {
            cells_ = cells_of_level_0(points_, octree_, b_);
            for (const Kind kind : {corner, centre}) {
                plus_[static_cast<std::size_t>(kind)] = points_.plus(b_, kind);
                zero_[static_cast<std::size_t>(kind)] = points_.zero(b_, kind);
            }
            if (Sink::numbers) number_points();
            for (int axis = 0; axis < 3; ++axis) faces_across(axis);
            for (int axis = 0; axis < 3; ++axis)
                for (const int step : {-1, 1}) cells_below_leaves(axis, step);
        }
        octree_.for_each_leaf(b_, [&](const Octant& leaf) { fill_leaf(leaf); });
    }

 private:
    struct Place {
        Kind kind;
        int x, y, z;
    };

    void number_points() {
        for (const Kind kind : {corner, centre})
            for (int x = 0; x <= dim; ++x)
                for (int y = 0; y <= dim; ++y)
                    for (int z = 0; z <= dim; ++z)
                        if (vertices_.used(b_, kind, x, y, z))
                            number_[static_cast<std::size_t>(kind)][x][y][z] =
                                vertices_.at(b_, kind, x, y, z);
    }

    VertexId number(const Place& p) const {
        return Sink::numbers ? number_[static_cast<std::size_t>(p.kind)][p.x][p.y][p.z] : 0;
    }
    bool is_plus(const Place& p) const { return plus_[static_cast<std::size_t>(p.kind)].at(p.x, p.y, p.z); }
    Sign sign(const Place& p) const {
        return is_plus(p)                                                  ? Sign::plus
               : zero_[static_cast<std::size_t>(p.kind)].at(p.x, p.y, p.z) ? Sign::zero
                                                                           : Sign::minus;
    }

    /// Corners of the upper face across the axis of cell (x, y, z), counter-clockwise seen from further up.
    static std::array<Place, 4> face(int axis, int x, int y, int z) {
        std::array<int, 3> c{x, y, z};
        const auto m = static_cast<std::size_t>(axis), n = (m + 1) % 3, o = (m + 2) % 3;
        ++c[m];
        std::array<std::array<int, 3>, 4> p{c, c, c, c};
        ++p[1][n], ++p[2][n], ++p[2][o], ++p[3][o];
        std::array<Place, 4> out;
        for (std::size_t k = 0; k < 4; ++k) out[k] = {corner, p[k][0], p[k][1], p[k][2]};
        return out;
    }

    /// Rows of faces between two cells of level 0: mostly all six points around are inside.
    void faces_across(int axis) {
        std::array<int, 3> up{};
        up[static_cast<std::size_t>(axis)] = 1;
        const std::array<Place, 4> ring = face(axis, 0, 0, 0);
        for (int x = 0; x < dim; ++x)
            for (int y = 0; y < dim; ++y) {
                const auto row = [&](const Halo& h, int i, int j, int k) { return h.row8(x + i, y + j, k); };
                const std::uint64_t pair = row(cells_, 0, 0, 0) & row(cells_, up[0], up[1], up[2]);
                std::uint64_t here = row(plus_[centre], 0, 0, 0),
                              there = row(plus_[centre], up[0], up[1], up[2]);
                std::uint64_t some = here | there, every = here & there;
                for (const Place& p : ring) {
                    const std::uint64_t corners = row(plus_[corner], p.x, p.y, p.z);
                    some |= corners, every &= corners;
                }
                every &= pair, some &= pair & ~every;
                if constexpr (Sink::numbers) {
                    for (; every; every &= every - 1) whole_face(axis, x, y, __builtin_ctzll(every), up);
                } else {
                    sink_.tets += 4 * static_cast<std::uint64_t>(__builtin_popcountll(every));
                }
                for (; some; some &= some - 1) cut_face(axis, x, y, __builtin_ctzll(some), up);
            }
    }

    void whole_face(int axis, int x, int y, int z, const std::array<int, 3>& up) {
        const std::array<Place, 4> p = face(axis, x, y, z);
        const VertexId c = number({centre, x, y, z}), d = number({centre, x + up[0], y + up[1], z + up[2]});
        for (std::size_t k = 0; k < 4; ++k) sink_.add({number(p[k]), number(p[(k + 1) % 4]), c, d}, 0);
    }

    void cut_face(int axis, int x, int y, int z, const std::array<int, 3>& up) {
        const std::array<Place, 4> p = face(axis, x, y, z);
        const Place c{centre, x, y, z}, d{centre, x + up[0], y + up[1], z + up[2]};
        for (std::size_t k = 0; k < 4; ++k) {
            const std::array<Place, 4> tet{p[k], p[(k + 1) % 4], c, d};
            const std::array<Sign, 4> s{sign(tet[0]), sign(tet[1]), sign(tet[2]), sign(tet[3])};
            const auto far = [&](std::size_t i, std::size_t j) {
                if (s[i] == s[j] || s[i] == Sign::zero || s[j] == Sign::zero) return false;
                const double part = cut_part(tet[i], tet[j]);
                return (s[i] == Sign::plus ? part : 1 - part) > 0.5;
            };
            // One of the corner's coordinates is larger than the centre's for p[0], two for p[1] …
            const Stencil& cut = stencil(s[0], s[1], s[2], s[3], k % 2 == 1, far(0, 1), far(2, 3));
            for (int t = 0; t < cut.count; ++t) add_cut(tet, s, cut.tets[static_cast<std::size_t>(t)]);
        }
    }

    void add_cut(const std::array<Place, 4>& tet, const std::array<Sign, 4>& s,
                 const std::array<std::uint8_t, 4>& refs) {
        unsigned on_surface = 0, cuts = 0;
        Tetrahedron numbers{};
        for (std::size_t k = 0; k < 4; ++k) {
            const std::uint8_t r = refs[k];
            if (r >= 4 || s[r] == Sign::zero) on_surface |= 1u << k;
            if (r >= 4) cuts |= 1u << k;
            if (Sink::numbers)
                numbers[k] =
                    r < 4 ? number(tet[r]) : cut_number(tet, tet_edges[static_cast<std::size_t>(r - 4)]);
        }
        FaceMask boundary = 0;
        for (std::size_t k = 0; k < 4; ++k) {
            const unsigned others = 0xFu & ~(1u << k);
            if ((on_surface & others) != others) continue;
            // A face of snapped points alone lies between two of the lattice's tetrahedra.
            if ((cuts & others) == 0 && is_plus(beyond(tet, refs[k]))) continue;
            boundary |= 1u << k;
        }
        sink_.add(numbers, boundary);
    }

    /// The fourth corner of the lattice's tetrahedron across the face opposite to corner k: the mirror image
    /// of that corner at the middle of the long edge which the face has.
    static Place beyond(const std::array<Place, 4>& tet, std::size_t k) {
        const Place &p = tet[k], &a = tet[k < 2 ? 2 : 0], &b = tet[k < 2 ? 3 : 1];
        const int half = p.kind == corner ? 1 : -1;  // slots of centres stand for half more
        return {p.kind, a.x + b.x - p.x + half, a.y + b.y - p.y + half, a.z + b.z - p.z + half};
    }

    /// The edge between two points: its owner and class.
    static std::pair<Place, int> edge_of(const Place& p, const Place& q) {
        if (p.kind != q.kind) {
            const Place &in = p.kind == centre ? p : q, &at = p.kind == centre ? q : p;
            return {in, 6 + (at.x - in.x) + 2 * (at.y - in.y) + 4 * (at.z - in.z)};
        }
        const bool up = q.x + q.y + q.z > p.x + p.y + p.z;
        const int axis = p.x != q.x ? 0 : p.y != q.y ? 1 : 2;
        return {up ? p : q, axis + (p.kind == centre ? 3 : 0)};
    }

    VertexId cut_number(const std::array<Place, 4>& tet, const std::array<int, 2>& edge) const {
        const auto [owner, edge_class] =
            edge_of(tet[static_cast<std::size_t>(edge[0])], tet[static_cast<std::size_t>(edge[1])]);
        return vertices_.cut_at(b_, edge_class, owner.x, owner.y, owner.z);
    }

    /// Where the cut point between p and q is, from p.
    double cut_part(const Place& p, const Place& q) const {
        const auto [owner, edge_class] = edge_of(p, q);
        const SurfaceBlock* s = points_.surface(points_.table().near(b_, owner.x, owner.y, owner.z));
        const int rank =
            s->cut[static_cast<std::size_t>(edge_class)].rank(owner.x & 7, owner.y & 7, owner.z & 7);
        const double part = s->parts[static_cast<std::size_t>(rank)];
        return owner.x == p.x && owner.y == p.y && owner.z == p.z && owner.kind == p.kind ? part : 1 - part;
    }

    void cells_below_leaves(int axis, int step) {
        std::array<int, 3> by{};
        by[static_cast<std::size_t>(axis)] = step;
        const Coord origin = points_.table()[b_].at;
        for (int x = 0; x < dim; ++x)
            for (int y = 0; y < dim; ++y)
                for (std::uint64_t row = cells_.row8(x, y) & ~cells_.row8(x + by[0], y + by[1], by[2]); row;
                     row &= row - 1)
                    half_pyramids({0, Coord(8 * origin[0] + x, 8 * origin[1] + y,
                                            8 * origin[2] + __builtin_ctzll(row))},
                                  axis, step);
    }

    // From here on corners are counted in cells, from the lattice's origin.

    VertexId middle(const Octant& o) const {
        if (!Sink::numbers) return 0;
        const Coord c = o.origin(), at = points_.table()[b_].at;
        if (o.level == 0)
            return vertices_.at(b_, centre, c[0] - 8 * at[0], c[1] - 8 * at[1], c[2] - 8 * at[2]);
        return vertices_.corner_at(b_, c.offsetBy(1 << (o.level - 1)));
    }
    VertexId number(const Coord& c) const { return Sink::numbers ? vertices_.corner_at(b_, c) : 0; }

    /// The corners of an octant's face, counter-clockwise seen from up the axis.
    static std::array<Coord, 4> face(const Octant& o, int axis, int step) {
        Coord c = o.origin();
        const int side = 1 << o.level, n = (axis + 1) % 3, q = (axis + 2) % 3;
        if (step > 0) c[axis] += side;
        std::array<Coord, 4> p{c, c, c, c};
        p[1][n] += side, p[2][n] += side, p[2][q] += side, p[3][q] += side;
        return p;
    }
    static Coord between(const Coord& a, const Coord& b) {
        return {(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2};
    }

    /// A tetrahedron on a triangle of an octant's face, whose corners run counter-clockwise seen from up the
    /// axis, and the octant's middle.
    void add_on_face(const Coord& a, const Coord& b, const Coord& c, VertexId apex, int step) {
        if (step < 0)
            sink_.add({number(a), number(b), number(c), apex}, 0);
        else
            sink_.add({number(b), number(a), number(c), apex}, 0);
    }

    void fill_leaf(const Octant& leaf) {
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1}) {
                const Octant next = leaf.moved(axis, step);
                if (!octree_.whole(next))
                    divided_face(leaf, axis, step);
                else if (octree_.whole(next.parent()))
                    half_pyramids(leaf, axis, step);
                else if (step > 0)
                    equal_face(leaf, next, axis);
            }
    }

    /// Four tetrahedra between the middles of two equal leaves and the sides of their common face; a side
    /// that smaller leaves beside it have divided divides its tetrahedron.
    void equal_face(const Octant& leaf, const Octant& next, int axis) {
        const std::array<Coord, 4> p = face(leaf, axis, 1);
        const VertexId c = middle(leaf), d = middle(next);
        for (std::size_t k = 0; k < 4; ++k) {
            const Coord &a = p[k], &b = p[(k + 1) % 4], m = between(a, b);
            if (vertices_.has_corner(b_, m)) {
                sink_.add({number(a), number(m), c, d}, 0);
                sink_.add({number(m), number(b), c, d}, 0);
            } else {
                sink_.add({number(a), number(b), c, d}, 0);
            }
        }
    }

    /// Eight tetrahedra on a face with four smaller leaves at its other side: around the face's middle.
    void divided_face(const Octant& leaf, int axis, int step) {
        const std::array<Coord, 4> p = face(leaf, axis, step);
        const VertexId c = middle(leaf);
        const Coord m = between(p[0], p[2]);
        for (std::size_t k = 0; k < 4; ++k) {
            const Coord &a = p[k], &b = p[(k + 1) % 4], side = between(a, b);
            add_on_face(a, side, m, c, step);
            add_on_face(side, b, m, c, step);
        }
    }

    /// Two tetrahedra on a face with a leaf of twice the size at its other side; they meet in the diagonal
    /// from the middle of the larger face.
    void half_pyramids(const Octant& leaf, int axis, int step) {
        const std::array<Coord, 4> p = face(leaf, axis, step);
        const VertexId c = middle(leaf);
        const int n = (axis + 1) % 3, o = (axis + 2) % 3;
        const bool low_n = (leaf.at[n] & 1) == 0, low_o = (leaf.at[o] & 1) == 0;
        const std::size_t m = low_o ? (low_n ? 2 : 3) : (low_n ? 1 : 0);
        add_on_face(p[m], p[(m + 1) % 4], p[(m + 2) % 4], c, step);
        add_on_face(p[m], p[(m + 2) % 4], p[(m + 3) % 4], c, step);
    }

    const SnappedLattice& points_;
    const Octree& octree_;
    const VertexTable& vertices_;
    const std::size_t b_;
    Sink& sink_;
    Halo cells_{};
    std::array<Halo, 2> plus_{}, zero_{};
    VertexId number_[2][dim + 1][dim + 1][dim + 1];
};

/// Whether all six dihedral angles are within the bounds that the method promises, and the tetrahedron is
/// positive.
bool within_bounds(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    // cos 10.7843° and cos 164.7392°, a hair wider for rounding.
    constexpr double largest = 0.98234, least = -0.96475;
    if (!(tet_determinant(a, b, c, d) > 0)) return false;
    const std::array<Vec3d, 4> p{a, b, c, d};
    std::array<Vec3d, 4> normal;
    std::array<double, 4> square;
    for (std::size_t k = 0; k < 4; ++k) {
        const auto& f = tet_faces[k];
        const Vec3d& o = p[static_cast<std::size_t>(f[0])];
        normal[k] = (p[static_cast<std::size_t>(f[1])] - o).cross(p[static_cast<std::size_t>(f[2])] - o);
        square[k] = normal[k].squaredNorm();
    }
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j) {
            const double cosine = -normal[i].dot(normal[j]), bound = cosine > 0 ? largest : least;
            if (!(cosine * cosine <= bound * bound * square[i] * square[j])) return false;
        }
    return true;
}

void check_angles(const TetMesh& mesh, std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
        const Tetrahedron& v = mesh.tets[t];
        if (!within_bounds(mesh.points[v[0]], mesh.points[v[1]], mesh.points[v[2]], mesh.points[v[3]]))
            throw NumericalError(
                fmt::format("tetrahedron {} of isosurface stuffing has an angle out of the bounds it "
                            "promises: a fault of "
                            "vdbgeo, please report it",
                            t));
    }
}

}  // namespace

TetMesh fill(const Lattice& lattice, const SnappedLattice& points, const Octree& octree,
             std::uint64_t max_tets, const Progress& progress) {
    const VertexTable vertices(points, octree);
    progress.report(0.1);
    const std::size_t blocks = points.table().size();
    std::vector<Counter> first(blocks + 1);
    parallel_for(blocks, 16, [&](std::size_t b) {
        BlockFiller<Counter>(points, octree, vertices, b, first[b + 1]).run();
    });
    for (std::size_t b = 0; b < blocks; ++b)
        first[b + 1].tets += first[b].tets, first[b + 1].faces += first[b].faces;
    const Counter total = first[blocks];
    if (total.tets > max_tets)
        throw NumericalError(
            fmt::format("{} tetrahedra, more than the {} allowed: try a larger cell", total.tets, max_tets));
    if (vertices.size() > TriMesh::max_vertices)
        throw NumericalError(
            fmt::format("{} vertices, more than 2^32-1: try a larger cell", vertices.size()));
    progress.report(0.3);

    TetMesh mesh;
    mesh.points.resize(vertices.size());
    mesh.tets.resize(total.tets);
    mesh.faces.resize(total.faces);
    mesh.face_regions.resize(total.faces);
    parallel_for(blocks, 16, [&](std::size_t b) { vertices.place(lattice, b, mesh.points); });
    progress.report(0.5);
    parallel_for(blocks, 4, [&](std::size_t b) {
        if (first[b].tets == first[b + 1].tets) return;
        Writer writer{mesh.tets.data() + first[b].tets, mesh.faces.data() + first[b].faces};
        BlockFiller<Writer>(points, octree, vertices, b, writer).run();
        check_angles(mesh, first[b].tets, first[b + 1].tets);
        for (std::uint64_t f = first[b].faces; f < first[b + 1].faces; ++f) mesh.face_regions[f] = {1, 0};
    });
    progress.report(1);
    return mesh;
}

}  // namespace vdbgeo::stuffing
