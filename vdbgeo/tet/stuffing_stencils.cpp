#include "vdbgeo/tet/stuffing_stencils.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::stuffing {
namespace {

using Corners = std::array<std::uint8_t, 4>;

constexpr int patterns = 81, choices = 8;

/// Place in the table: the signs in base three, and the three choices.
std::size_t place(int a, int b, int c, int d, bool even, bool far_ab, bool far_cd) {
    const int choice = (even ? 1 : 0) + (far_ab ? 2 : 0) + (far_cd ? 4 : 0);
    return static_cast<std::size_t>((((a * 3 + b) * 3 + c) * 3 + d) * choices + choice);
}

/// Makes the stencil of one pattern of signs.
class Maker {
 public:
    Maker(const std::array<int, 4>& signs, bool even, bool far_ab, bool far_cd)
        : sign_(signs), even_(even), far_{far_ab, far_cd} {
        for (int k = 0; k < 4; ++k) of_[static_cast<std::size_t>(sign(k))].push_back(k);
    }

    Stencil make() {
        const auto &out = of_[0], &zero = of_[1], &in = of_[2];
        if (in.empty()) return result_;
        if (out.empty()) {
            add({0, 1, 2, 3});
        } else if (in.size() == 1) {
            Corners tet{};
            for (int k = 0; k < 4; ++k)
                tet[static_cast<std::size_t>(k)] = sign(k) == 0 ? cut(in[0], k) : lattice(k);
            add(tet);
        } else if (in.size() == 3) {
            const int m = out[0];
            prism({lattice(in[0]), lattice(in[1]), lattice(in[2])},
                  {cut(in[0], m), cut(in[1], m), cut(in[2], m)});
        } else if (zero.size() == 1) {
            const int p = in[0], q = in[1], m = out[0];
            const std::uint8_t apex = lattice(zero[0]), pm = cut(p, m), qm = cut(q, m);
            const bool from_p = joined(lattice(p), qm);
            add({lattice(p), lattice(q), from_p ? qm : pm, apex});
            add({from_p ? lattice(p) : lattice(q), qm, pm, apex});
        } else {
            const int p = in[0], q = in[1], m = out[0], n = out[1];
            prism({lattice(p), cut(p, m), cut(p, n)}, {lattice(q), cut(q, m), cut(q, n)});
        }
        return result_;
    }

 private:
    int sign(int k) const { return sign_[static_cast<std::size_t>(k)]; }
    static std::uint8_t lattice(int k) { return static_cast<std::uint8_t>(k); }
    static std::uint8_t cut(int p, int q) {
        for (std::size_t e = 0; e < 6; ++e)
            if (tet_edges[e][0] == std::min(p, q) && tet_edges[e][1] == std::max(p, q))
                return static_cast<std::uint8_t>(4 + e);
        return 0;
    }
    static bool is_long(int p, int q) { return p / 2 == q / 2; }

    /// Whether an even number of coordinates of p are larger than those of q, over a short edge. B and D are
    /// a step along one axis from A and C, and from p to q all three coordinates change.
    bool is_even(int p, int q) const {
        const bool b = p == 1 || q == 1, d = p == 3 || q == 3, back = p >= 2;
        return even_ ^ b ^ d ^ back;
    }

    /// Whether the diagonal of a quadrilateral on a face runs from lattice point p to the cut point on the
    /// edge from `q` to the point outside.
    bool from(int p, int q, int m) const {
        if (is_long(p, q)) return is_even(p, m);
        const bool far = far_[static_cast<std::size_t>(m / 2)];  // m is an end of the long one
        return is_long(q, m) != far;
    }

    /// Whether a diagonal of a face joins a lattice point and a cut point of the other inside corner.
    bool joined(std::uint8_t point, std::uint8_t cut_point) const {
        const auto& edge = tet_edges[static_cast<std::size_t>(cut_point - 4)];
        const bool first_in = sign(edge[0]) == 2;
        return from(point, first_in ? edge[0] : edge[1], first_in ? edge[1] : edge[0]);
    }

    /// Which of a prism's sides (i, j) has the diagonal from bottom i to top j: -1 where it may be either.
    int side(const std::array<std::uint8_t, 3>& bottom, const std::array<std::uint8_t, 3>& top, std::size_t i,
             std::size_t j) const {
        if (bottom[i] < 4 && top[j] >= 4) return joined(bottom[i], top[j]);
        if (bottom[j] < 4 && top[i] >= 4) return !joined(bottom[j], top[i]);
        if (top[j] < 4 && bottom[i] >= 4) return joined(top[j], bottom[i]);
        if (top[i] < 4 && bottom[j] >= 4) return !joined(top[i], bottom[j]);
        return -1;
    }

    /// Sorts the prism's edges so that all diagonals run from the bottom of an earlier to the top of a later
    /// one; the order exists unless the diagonals run in a circle.
    void prism(const std::array<std::uint8_t, 3>& bottom, const std::array<std::uint8_t, 3>& top) {
        std::array<std::size_t, 3> o{0, 1, 2};
        do {
            if (side(bottom, top, o[0], o[1]) != 0 && side(bottom, top, o[0], o[2]) != 0 &&
                side(bottom, top, o[1], o[2]) != 0) {
                add({bottom[o[0]], top[o[0]], top[o[1]], top[o[2]]});
                add({bottom[o[0]], bottom[o[1]], top[o[1]], top[o[2]]});
                add({bottom[o[0]], bottom[o[1]], bottom[o[2]], top[o[2]]});
                return;
            }
        } while (std::next_permutation(o.begin(), o.end()));
    }

    /// Adds a tetrahedron, turned so that it is positive in the lattice's tetrahedron with all cuts halfway.
    void add(Corners tet) {
        const std::array<Vec3d, 4> shape{Vec3d(0, 0, 0), Vec3d(2, 0, 0), Vec3d(1, 1, -1), Vec3d(1, 1, 1)};
        const auto at = [&](std::uint8_t v) -> Vec3d {
            if (v < 4) return shape[v];
            const auto& edge = tet_edges[static_cast<std::size_t>(v - 4)];
            return 0.5 *
                   (shape[static_cast<std::size_t>(edge[0])] + shape[static_cast<std::size_t>(edge[1])]);
        };
        if (tet_determinant(at(tet[0]), at(tet[1]), at(tet[2]), at(tet[3])) < 0) std::swap(tet[2], tet[3]);
        result_.tets[static_cast<std::size_t>(result_.count++)] = tet;
    }

    std::array<int, 4> sign_;
    bool even_;
    std::array<bool, 2> far_;
    std::array<std::vector<int>, 3> of_;
    Stencil result_;
};

using Table = std::array<Stencil, patterns * choices>;

Table make_all() {
    Table table;
    for (int n = 0; n < patterns; ++n)
        for (int choice = 0; choice < choices; ++choice) {
            const int a = n / 27, b = n / 9 % 3, c = n / 3 % 3, d = n % 3;
            const bool even = choice & 1, far_ab = choice & 2, far_cd = choice & 4;
            table[place(a, b, c, d, even, far_ab, far_cd)] = Maker({a, b, c, d}, even, far_ab, far_cd).make();
        }
    return table;
}

const Table table = make_all();

}  // namespace

const Stencil& stencil(Sign a, Sign b, Sign c, Sign d, bool even, bool far_ab, bool far_cd) {
    return table[place(static_cast<int>(a), static_cast<int>(b), static_cast<int>(c), static_cast<int>(d),
                       even, far_ab, far_cd)];
}

}  // namespace vdbgeo::stuffing
