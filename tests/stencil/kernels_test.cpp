#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "vdbgeo/stencil/plane_kernels.h"

namespace vdbgeo {
namespace {

using namespace stencil;

constexpr int rows = 11;
constexpr std::ptrdiff_t stride = 48;
/// A plane with a guard on both sides, as the tiles have it. Rows begin on cache lines.
struct Plane {
    static constexpr std::ptrdiff_t guard = 2;  // cache lines
    struct alignas(64) Line {
        float v[lanes] = {};
    };
    std::vector<Line> lines = std::vector<Line>(2 * guard + rows * stride / lanes);
    float* data() { return lines[guard].v; }
    std::size_t size() const { return lines.size() * lanes; }
    float* all() { return lines[0].v; }
};

/// Random planes: values, diffusivities with a quarter of the voxels inactive, spans around the active ones.
struct Input {
    std::vector<Plane> u{3}, d{3}, extra{4};
    std::vector<RowSpan> spans;

    explicit Input(std::uint64_t seed) {
        std::mt19937_64 random(seed);
        const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
        for (auto* group : {&u, &d, &extra})
            for (Plane& p : *group)
                for (std::ptrdiff_t i = 0; i < rows * stride; ++i) {
                    const bool off = group == &d && uniform() < 0.25;
                    p.data()[i] =
                        off ? inactive : static_cast<float>(group == &d ? uniform() : 2 * uniform() - 1);
                }
        for (int y = 0; y < rows; ++y) {
            auto begin = static_cast<std::int16_t>(y % 3 == 0 ? 0 : uniform() * 40);
            auto end = static_cast<std::int16_t>(y % 4 == 0 ? 48 : begin + uniform() * (48 - begin));
            if (y == 5) std::swap(begin = 48, end = 0);
            spans.push_back({begin, end});
            for (std::ptrdiff_t z = 0; z < stride; ++z)
                if (z < begin || z >= end) d[1].data()[y * stride + z] = inactive;
        }
    }
    PlaneRange range() { return {1, rows - 1, stride, spans.data()}; }
    Planes planes(std::vector<Plane>& from) { return {from[0].data(), from[1].data(), from[2].data()}; }
    bool active(int y, std::ptrdiff_t z) { return d[1].data()[y * stride + z] >= 0; }
};

/// Σ over the six neighbours of f(value here, there, d here, there) · weight.
template <class F>
double around(Input& in, int y, std::ptrdiff_t z, const float weight[3], const F& f) {
    const std::ptrdiff_t o = y * stride + z;
    const auto term = [&](std::size_t plane, std::ptrdiff_t at) {
        return f(static_cast<double>(in.u[1].data()[o]), static_cast<double>(in.u[plane].data()[at]),
                 static_cast<double>(in.d[1].data()[o]), static_cast<double>(in.d[plane].data()[at]));
    };
    return weight[0] * (term(0, o) + term(2, o)) + weight[1] * (term(1, o - stride) + term(1, o + stride)) +
           weight[2] * (term(1, o - 1) + term(1, o + 1));
}

double no_flux(double u, double n, double here, double there) { return there >= 0 && here >= 0 ? u - n : 0; }
double flux_of(double u, double n, double here, double there) {
    return here >= 0 && there >= 0 ? (here + there) * (n - u) : 0;
}

constexpr float weight[3] = {0.7f, 0.2f, 0.05f};

TEST(Kernels, AreThereForThisCpu) {
    ASSERT_FALSE(available_kernels().empty());
    EXPECT_STREQ(available_kernels().front()->name, "baseline");
    bool known = false;
    for (const Kernels* k : available_kernels()) known = known || k == &kernels();
    EXPECT_TRUE(known);
}

TEST(Kernels, LaplacianIsTheSumOverActiveNeighbours) {
    for (const Kernels* k : available_kernels()) {
        Input in(1);
        k->laplacian(in.range(), in.planes(in.u), in.planes(in.d), weight, in.extra[0].data());
        for (int y = 1; y < rows - 1; ++y)
            for (std::ptrdiff_t z = in.spans[static_cast<std::size_t>(y)].begin;
                 z < in.spans[static_cast<std::size_t>(y)].end; ++z)
                EXPECT_NEAR(in.extra[0].data()[y * stride + z], around(in, y, z, weight, no_flux), 1e-6)
                    << k->name;
    }
}

TEST(Kernels, FluxIsAddedOrSet) {
    for (const Kernels* k : available_kernels())
        for (const bool add : {false, true}) {
            Input in(2);
            std::vector<float> before(in.extra[0].data(), in.extra[0].data() + rows * stride);
            k->flux(in.range(), in.planes(in.u), in.planes(in.d), weight, add, in.extra[0].data());
            for (int y = 1; y < rows - 1; ++y)
                for (std::ptrdiff_t z = in.spans[static_cast<std::size_t>(y)].begin;
                     z < in.spans[static_cast<std::size_t>(y)].end; ++z) {
                    const double old = add ? before[static_cast<std::size_t>(y * stride + z)] : 0;
                    EXPECT_NEAR(in.extra[0].data()[y * stride + z], old + around(in, y, z, weight, flux_of),
                                2e-6)
                        << k->name;
                }
        }
}

StepPlane step_of(Input& in, bool gathered, bool target) {
    StepPlane s{};
    s.w = in.planes(in.u);
    s.d = in.planes(in.d);
    s.here = in.extra[0].data();
    s.next = in.extra[1].data();
    s.gathered = gathered ? in.extra[2].data() : nullptr;
    s.target = target ? in.extra[3].data() : nullptr;
    std::copy(weight, weight + 3, s.weight);
    s.relaxation = 1.7f;
    s.fidelity = 0.3f;
    return s;
}

TEST(Kernels, StepIsWhatItSays) {
    for (const Kernels* k : available_kernels())
        for (int options = 0; options < 4; ++options) {
            Input in(3);
            const std::vector<float> before(in.extra[1].data(), in.extra[1].data() + rows * stride);
            const StepPlane s = step_of(in, options & 1, options & 2);
            k->step(in.range(), s);
            for (int y = 1; y < rows - 1; ++y)
                for (std::ptrdiff_t z = in.spans[static_cast<std::size_t>(y)].begin;
                     z < in.spans[static_cast<std::size_t>(y)].end; ++z) {
                    const std::ptrdiff_t o = y * stride + z;
                    const double old = before[static_cast<std::size_t>(o)], here = s.here[o];
                    double expected = old + 1.7 * (here - old) + around(in, y, z, weight, flux_of);
                    if (s.gathered) expected += s.gathered[o];
                    if (s.target) expected += 0.3 * (s.target[o] - here);
                    EXPECT_NEAR(s.next[o], expected, 4e-6) << k->name;
                }
        }
}

/// Outside the spans, cut to whole vectors, nothing is written.
TEST(Kernels, WriteNothingElsewhere) {
    for (const Kernels* k : available_kernels()) {
        Input in(4);
        Plane before = in.extra[1];
        k->step(in.range(), step_of(in, true, true));
        k->laplacian(in.range(), in.planes(in.u), in.planes(in.d), weight, in.extra[1].data());
        k->flux(in.range(), in.planes(in.u), in.planes(in.d), weight, true, in.extra[1].data());
        const std::ptrdiff_t first = in.extra[1].data() - in.extra[1].all();
        for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(before.size()); ++i) {
            const std::ptrdiff_t o = i - first, y = o < 0 ? -1 : o / stride, z = o - y * stride;
            const bool inside = y >= 1 && y < rows - 1;
            const RowSpan span = inside ? in.spans[static_cast<std::size_t>(y)] : RowSpan{0, 0};
            if (span.begin < span.end && z >= span.begin / lanes * lanes &&
                z < (span.end + lanes - 1) / lanes * lanes)
                continue;
            EXPECT_EQ(in.extra[1].all()[i], before.all()[i]) << k->name;
        }
    }
}

TEST(Kernels, EdgeStoppingIsTheExponential) {
    std::vector<float> gradient2, variance;
    for (int i = 0; i < 4099; ++i) {
        gradient2.push_back(static_cast<float>(1e-3 * i));
        variance.push_back(static_cast<float>(0.05 + 0.001 * (i % 97)));
    }
    std::vector<float> out(gradient2.size()), active(gradient2.size(), 1.0f);
    active[11] = 0;
    for (const Kernels* k : available_kernels()) {
        k->edge_stopping(out.size(), gradient2.data(), variance.data(), active.data(), 2.5f, out.data());
        for (std::size_t i = 0; i < out.size(); ++i) {
            if (active[i] == 0) {
                EXPECT_EQ(out[i], inactive);
                continue;
            }
            const double x = -gradient2[i] / (2.0 * variance[i]);
            // The rounding of x to float counts where it is large.
            EXPECT_NEAR(out[i], 2.5 * std::exp(std::max(x, -40.0)),
                        2.5 * std::exp(x) * (5e-7 + 2e-7 * std::abs(x)) + 1e-16)
                << k->name << " at " << x;
        }
        EXPECT_EQ(out[0], 2.5f) << "no gradient, no stopping";
    }
}

TEST(Kernels, AllSetsGiveTheSameBits) {
    const std::size_t bytes = rows * stride * sizeof(float);
    for (std::uint64_t seed = 10; seed < 40; ++seed) {
        Input first(seed);
        const Kernels& plain = *available_kernels().front();
        const auto run = [&](const Kernels& k, Input& in, int what) {
            float* out = in.extra[1].data();
            if (what == 0) k.laplacian(in.range(), in.planes(in.u), in.planes(in.d), weight, out);
            if (what == 1) k.flux(in.range(), in.planes(in.u), in.planes(in.d), weight, false, out);
            if (what == 2) k.flux(in.range(), in.planes(in.u), in.planes(in.d), weight, true, out);
            if (what >= 3 && what < 7) k.step(in.range(), step_of(in, (what - 3) & 1, (what - 3) & 2));
            if (what == 7)
                k.edge_stopping(rows * stride - 3, in.d[0].data(), in.d[2].data(), in.u[2].data(), 0.3f, out);
        };
        for (int what = 0; what < 8; ++what) {
            Input a(seed);
            if (what == 7)
                for (Plane& p : a.d)
                    for (std::ptrdiff_t i = 0; i < rows * stride; ++i)
                        p.data()[i] = std::abs(a.u[0].data()[i]) + 1e-3f;
            Input expected = a;
            run(plain, expected, what);
            for (const Kernels* k : available_kernels()) {
                Input in = a;
                run(*k, in, what);
                EXPECT_EQ(std::memcmp(in.extra[1].data(), expected.extra[1].data(), bytes), 0)
                    << k->name << ", kernel " << what;
            }
        }
    }
}

/// 1 where active, 0 elsewhere.
void to_activity(Input& in) {
    for (Plane& p : in.d)
        for (std::ptrdiff_t i = 0; i < rows * stride; ++i) p.data()[i] = p.data()[i] >= 0 ? 1.0f : 0.0f;
}

constexpr float scale[3] = {1, 0.5f, 0.25f};

TEST(Kernels, GradientTakesTheOwnValueForWhatIsMissing) {
    for (const Kernels* k : available_kernels())
        for (const bool components : {true, false}) {
            Input in(5);
            to_activity(in);
            float* g[3] = {in.extra[0].data(), in.extra[1].data(), in.extra[2].data()};
            k->gradient(in.range(), in.planes(in.u), in.planes(in.d), scale, components ? g : nullptr,
                        in.extra[3].data());
            for (int y = 1; y < rows - 1; ++y)
                for (std::ptrdiff_t z = in.spans[static_cast<std::size_t>(y)].begin;
                     z < in.spans[static_cast<std::size_t>(y)].end; ++z) {
                    const std::ptrdiff_t o = y * stride + z;
                    const double v = in.u[1].data()[o];
                    const auto at = [&](std::size_t plane, std::ptrdiff_t i) {
                        return in.d[plane].data()[i] > 0 ? static_cast<double>(in.u[plane].data()[i]) : v;
                    };
                    const bool on = in.d[1].data()[o] > 0;
                    const double expected[3] = {on * (at(2, o) - at(0, o)) / 2,
                                                on * (at(1, o + stride) - at(1, o - stride)) / 4,
                                                on * (at(1, o + 1) - at(1, o - 1)) / 8};
                    double square = 0;
                    for (std::size_t c = 0; c < 3; ++c) {
                        square += expected[c] * expected[c];
                        if (components) {
                            EXPECT_NEAR(g[c][o], expected[c], 3e-7) << k->name;
                        }
                    }
                    EXPECT_NEAR(in.extra[3].data()[o], square, 6e-7) << k->name;
                }
        }
}

TEST(Kernels, WindowSumsAndVariances) {
    constexpr std::size_t n = 4 * lanes;
    Input in(6);
    const float* row = in.u[1].data() + stride;
    for (const Kernels* k : available_kernels())
        for (const int r : {1, 2, 8}) {
            std::vector<double> sum(n), square(n), total(n), count(n, 2.0 * r + 1);
            k->window_sum(n, r, row, false, sum.data());
            k->window_sum(n, r, row, true, square.data());
            const double* const three[] = {sum.data(), square.data(), sum.data()};
            k->sum_rows(n, 3, three, total.data());
            std::vector<float> variance(n);
            const double* const sums[] = {sum.data()};
            k->variance(n, count.data(), square.data(), sums, 1, 2.0f, 0.1f, variance.data());
            for (std::size_t i = 0; i < n; ++i) {
                double s = 0, s2 = 0;
                for (int j = -r; j <= r; ++j) {
                    const double v = row[static_cast<std::ptrdiff_t>(i) + j];
                    s += v;
                    s2 += v * v;
                }
                EXPECT_NEAR(sum[i], s, 1e-12) << k->name;
                EXPECT_NEAR(square[i], s2, 1e-12) << k->name;
                EXPECT_NEAR(total[i], 2 * s + s2, 1e-12) << k->name;
                const double mean = s / count[i];
                EXPECT_NEAR(variance[i], std::max(0.1, 2 * (s2 / count[i] - mean * mean)), 1e-6) << k->name;
            }
        }
}

TEST(Kernels, AllSetsGiveTheSameBitsOfWindows) {
    constexpr std::size_t n = 6 * lanes;
    for (std::uint64_t seed = 50; seed < 70; ++seed) {
        std::vector<float> first;
        std::vector<double> first_sums;
        for (const Kernels* k : available_kernels()) {
            Input in(seed);
            to_activity(in);
            float* g[3] = {in.extra[0].data(), in.extra[1].data(), in.extra[2].data()};
            k->gradient(in.range(), in.planes(in.u), in.planes(in.d), scale, g, in.extra[3].data());
            std::vector<float> out;
            for (Plane& p : in.extra) out.insert(out.end(), p.data(), p.data() + rows * stride);
            std::vector<double> sums(4 * n);
            const float* row = in.u[0].data() + 2 * stride;
            k->window_sum(n, 3, row, false, sums.data());
            k->window_sum(n, 3, row, true, sums.data() + n);
            const double* const both[] = {sums.data(), sums.data() + n, sums.data()};
            k->sum_rows(n, 3, both, sums.data() + 2 * n);
            std::fill_n(sums.data() + 3 * n, n, 7.0);
            std::vector<float> variance(n);
            k->variance(n, sums.data() + 3 * n, sums.data() + n, both, 3, 1.3f, 1e-3f, variance.data());
            out.insert(out.end(), variance.begin(), variance.end());
            if (first.empty()) {
                first = out;
                first_sums = sums;
            }
            EXPECT_EQ(std::memcmp(out.data(), first.data(), out.size() * sizeof(float)), 0) << k->name;
            EXPECT_EQ(std::memcmp(sums.data(), first_sums.data(), sums.size() * sizeof(double)), 0)
                << k->name;
        }
    }
}

}  // namespace
}  // namespace vdbgeo
