#include "vdbgeo/tet/stuffing_stencils.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "tests/tet/dihedrals.h"
#include "vdbgeo/tet/stuffing_snap.h"

namespace vdbgeo {
namespace {

using test::dihedrals;

/// A tetrahedron of the lattice with its cut points and snapped corners anywhere that the rules allow.
class AnyTetrahedron {
 public:
    AnyTetrahedron(const std::array<int, 4>& signs, std::uint64_t seed, bool mirrored)
        : sign_(signs), mirrored_(mirrored), random_(seed) {
        for (const auto& e : stuffing::incident_edges(stuffing::corner)) steps_.push_back(e.direction);
        for (std::size_t k = 0; k < 4; ++k) draw_snap(k);
        for (std::size_t e = 0; e < 6; ++e) draw_cut(e);
    }

    /// Draws one or two numbers anew.
    void vary() {
        for (std::uint64_t n = 1 + random_() % 2; n > 0; --n) {
            const std::size_t which = random_() % 10;
            if (which < 4)
                draw_snap(which);
            else
                draw_cut(which - 4);
        }
    }

    /// Least and largest dihedral angle of the stencil; nothing where two snapped points come towards each
    /// other or a point is snapped towards one on its own side.
    std::optional<std::pair<double, double>> angles() const {
        std::array<Vec3d, 10> p;
        for (std::size_t k = 0; k < 4; ++k) {
            p[k] = lattice(k);
            if (sign_[k] != 1) continue;
            for (std::size_t j = 0; j < 4; ++j)
                if (j != k && (p[k] + steps_[direction_[k]] - lattice(j)).norm() < 1e-9 &&
                    (sign_[j] == 1 || (sign_[j] == 2) == from_inside_[k]))
                    return {};
            p[k] += part_[k] * steps_[direction_[k]];
        }
        for (std::size_t e = 0; e < 6; ++e) {
            const auto a = static_cast<std::size_t>(tet_edges[e][0]),
                       b = static_cast<std::size_t>(tet_edges[e][1]);
            p[4 + e] = lattice(a) + cut_[e] * (lattice(b) - lattice(a));
        }
        int larger = 0;
        for (int a = 0; a < 3; ++a) larger += lattice(0)[a] > lattice(2)[a];
        const auto far = [&](std::size_t from, std::size_t edge) {
            return (sign_[from] == 2 ? cut_[edge] : 1 - cut_[edge]) > 0.5;
        };
        const auto s = [&](std::size_t k) { return static_cast<stuffing::Sign>(sign_[k]); };
        const stuffing::Stencil& stencil =
            stuffing::stencil(s(0), s(1), s(2), s(3), larger % 2 == 0, far(0, 0), far(2, 5));
        std::pair<double, double> range{180, 0};
        for (int t = 0; t < stencil.count; ++t) {
            std::array<Vec3d, 4> q;
            for (std::size_t k = 0; k < 4; ++k) q[k] = p[stencil.tets[static_cast<std::size_t>(t)][k]];
            for (const double a : dihedrals(q)) range = {std::min(range.first, a), std::max(range.second, a)};
        }
        return range;
    }

 private:
    Vec3d lattice(std::size_t k) const {
        const std::array<Vec3d, 4> p{Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0.5, 0.5, -0.5),
                                     Vec3d(0.5, 0.5, 0.5)};
        return mirrored_ ? Vec3d(p[k].x(), -p[k].z(), p[k].y()) : p[k];  // a quarter turn: the other parity
    }
    double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
    void draw_snap(std::size_t k) {
        direction_[k] = random_() % 14;
        from_inside_[k] = random_() % 2 == 0;
        const double most = direction_[k] < 6 ? stuffing::alpha_long : stuffing::alpha_short;
        part_[k] = uniform() < 0.5 ? most : most * uniform();
    }
    void draw_cut(std::size_t e) {
        const double least = e == 0 || e == 5 ? stuffing::alpha_long : stuffing::alpha_short;
        const double where = uniform();
        cut_[e] = where < 0.35   ? least
                  : where < 0.7  ? 1 - least
                  : where < 0.75 ? 0.5
                  : where < 0.8  ? std::nextafter(0.5, 1)
                                 : least + (1 - 2 * least) * uniform();
    }

    std::array<int, 4> sign_;
    bool mirrored_;
    std::mt19937_64 random_;
    std::vector<Vec3d> steps_;
    std::array<std::size_t, 4> direction_{};
    std::array<bool, 4> from_inside_{};
    std::array<double, 4> part_{};
    std::array<double, 6> cut_{};
};

TEST(StuffingStencils, KeepTheAnglesWhereverThePointsAre) {
    double least = 180, largest = 0;
    for (int n = 0; n < 81; ++n)
        for (const bool mirrored : {false, true})
            for (std::uint64_t seed = 0; seed < 24; ++seed) {
                const std::array<int, 4> signs{n / 27, n / 9 % 3, n / 3 % 3, n % 3};
                AnyTetrahedron tet(signs, 1000 * static_cast<std::uint64_t>(n) + seed, mirrored);
                std::pair<double, double> best{180, 0};
                for (int step = 0; step < 120; ++step) {  // downhill
                    AnyTetrahedron next = tet;
                    next.vary();
                    tet.vary();
                    const auto range = next.angles();
                    if (!range) continue;
                    if (seed % 2 ? range->second < best.second : range->first > best.first) continue;
                    tet = next;
                    best = *range;
                }
                least = std::min(least, best.first), largest = std::max(largest, best.second);
            }
    EXPECT_GT(least, 11.69);
    EXPECT_LT(least, 12.5) << "the search has not come near the worst case";
    EXPECT_LT(largest, 162.61);
    EXPECT_GT(largest, 160.0);
}

TEST(StuffingStencils, FillTheInside) {
    // With all cuts halfway the volumes are known: of two regions of opposite signs they add up to the whole.
    for (int n = 0; n < 81; ++n)
        for (int choice = 0; choice < 8; ++choice) {
            const std::array<int, 4> sign{n / 27, n / 9 % 3, n / 3 % 3, n % 3};
            if (std::count(sign.begin(), sign.end(), 2) + std::count(sign.begin(), sign.end(), 0) == 0)
                continue;
            double sum = 0;
            for (const bool turned : {false, true}) {
                const auto s = [&](std::size_t k) {
                    return static_cast<stuffing::Sign>(turned ? 2 - sign[k] : sign[k]);
                };
                const auto& st =
                    stuffing::stencil(s(0), s(1), s(2), s(3), choice & 1, choice & 2, choice & 4);
                for (int t = 0; t < st.count; ++t) {
                    std::array<Vec3d, 4> q;
                    for (std::size_t k = 0; k < 4; ++k) {
                        const std::array<Vec3d, 4> p{Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0.5, 0.5, -0.5),
                                                     Vec3d(0.5, 0.5, 0.5)};
                        const std::size_t r = st.tets[static_cast<std::size_t>(t)][k];
                        q[k] = r < 4 ? p[r]
                                     : Vec3d(0.5 * (p[static_cast<std::size_t>(tet_edges[r - 4][0])] +
                                                    p[static_cast<std::size_t>(tet_edges[r - 4][1])]));
                    }
                    sum += tet_determinant(q[0], q[1], q[2], q[3]) / 6;
                }
            }
            EXPECT_NEAR(sum, 1.0 / 12, 1e-12) << n << " " << choice;
        }
}

}  // namespace
}  // namespace vdbgeo
