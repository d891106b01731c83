#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "tests/stencil/bricks.h"
#include "tests/support/dense_oracle.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/stencil/diffusion_sweep.h"
#include "vdbgeo/stencil/plane_kernels.h"

namespace vdbgeo {
namespace {

using stencil::BlockLayout;
using stencil::ShiftedField;
using stencil::SweepField;
using stencil::SweepPlan;
using test::Oracle;
using test::State;
using test::Values;

/// What one field of a plan does, said once for the sweep and for the oracle.
struct FieldCase {
    std::vector<int> orders;
    std::vector<bool> variable;  // has a diffusivity field; else 1 everywhere
    std::vector<double> factors;
    double coupling = 0;
    bool target = false;  // a field of its own
};

struct Case {
    std::string name;
    std::vector<FieldCase> fields;
    std::vector<int> sweeps;  // steps in each
    bool fsi = true;
    Vec3d weights = Vec3d::Ones();
};

/// Random fields, the sweep's memory and the oracle's lists.
class Setting {
 public:
    Setting(const openvdb::FloatGrid& grid, const Case& c)
        : case_(c), layout_(grid.tree()), oracle_(grid, c.weights), make_(17) {
        for (const FieldCase& f : c.fields) {
            start_.push_back(random(-1, 1));
            target_.push_back(random(-1, 1));
            target_bricks_.push_back(bricks(target_.back(), 0));
            std::vector<Values> d;
            std::vector<std::vector<float>> d_bricks;
            for (const bool variable : f.variable) {
                d.push_back(variable ? random(0, 1) : Values(oracle_.size(), 1.0));
                d_bricks.push_back(bricks(d.back(), stencil::inactive));
            }
            d_.push_back(d);
            d_bricks_.push_back(std::move(d_bricks));
        }
        double rate = 0;
        for (const FieldCase& f : c.fields) {
            double own = 2 * f.coupling;
            for (std::size_t t = 0; t < f.orders.size(); ++t)
                own += f.factors[t] * std::pow(4 * c.weights.sum(), f.orders[t] + 1);
            rate = std::max(rate, own);
        }
        tau_ = 1.9 / rate;
    }

    const BlockLayout& layout() const { return layout_; }
    const Oracle& oracle() const { return oracle_; }
    std::vector<SweepPlan::Step> steps() const {
        std::vector<SweepPlan::Step> out;
        for (const int n : case_.sweeps)
            for (int i = 0; i < n; ++i) {
                const double k = static_cast<double>(out.size());
                out.push_back({case_.fsi ? (4 * k + 2) / (2 * k + 3) : 1.0, tau_});
            }
        return out;
    }

    /// All sweeps; the last values of the fields. `box`: so that they are right there, each sweep working on
    /// as little as will do; what is not computed has to be finite then.
    std::vector<std::vector<float>> run(const std::optional<openvdb::CoordBBox>& box = {}) const {
        const float unset = box ? 1e30f : std::numeric_limits<float>::quiet_NaN();
        BlockLayout layout = layout_;
        std::vector<std::unique_ptr<ShiftedField>> now, before;
        const std::size_t floats = layout_.brick_count() * 512;
        for (const Values& v : start_) {
            for (auto* list : {&now, &before}) {
                list->push_back(std::make_unique<ShiftedField>(layout_));
                std::fill_n(list->back()->next(), floats, unset);
                std::fill_n(list->back()->now(), floats, unset);
            }
            test::to_bricks(layout_, oracle_, v, 0, now.back()->now());
        }
        const std::vector<SweepPlan::Step> all = steps();
        std::size_t at = 0;
        for (std::size_t s = 0; s < case_.sweeps.size(); ++s) {
            SweepPlan plan;
            plan.weights = case_.weights;
            plan.begins = s == 0;
            plan.ends = s + 1 == case_.sweeps.size();
            const auto n = static_cast<std::size_t>(case_.sweeps[s]);
            plan.steps.assign(all.begin() + static_cast<std::ptrdiff_t>(at),
                              all.begin() + static_cast<std::ptrdiff_t>(at + n));
            at += n;
            for (std::size_t i = 0; i < case_.fields.size(); ++i)
                plan.fields.push_back(field(i, now[i].get(), before[i].get()));
            if (box) {
                openvdb::CoordBBox wanted = *box;
                wanted.expand(static_cast<int>(all.size() - at) * (highest_order() + 1));
                layout.work_on(wanted);
            }
            stencil::sweep(layout, plan);
        }
        std::vector<std::vector<float>> out;
        for (const auto& f : now) {
            const ShiftedField& state = *f;
            out.emplace_back(state.now(), state.now() + floats);
        }
        return out;
    }

    int highest_order() const {
        int order = 0;
        for (const FieldCase& f : case_.fields)
            for (const int q : f.orders) order = std::max(order, q);
        return order;
    }

    State expected() const {
        const auto rate = [this](const State& s) {
            State out(s.size(), Values(oracle_.size()));
            for (std::size_t i = 0; i < s.size(); ++i) {
                const FieldCase& f = case_.fields[i];
                for (std::size_t t = 0; t < f.orders.size(); ++t)
                    Oracle::add(out[i], -f.factors[t],
                                oracle_.flux(oracle_.power(s[i], f.orders[t]), d_[i][t]));
                if (f.coupling == 0) continue;
                const Values& to = f.target ? target_[i] : s[1 - i];
                for (std::size_t v = 0; v < to.size(); ++v) out[i][v] += f.coupling * (to[v] - s[i][v]);
            }
            return out;
        };
        if (case_.fsi) return test::fsi_cycle(start_, static_cast<int>(steps().size()), tau_, rate);
        State s = start_;
        for (std::size_t k = 0; k < steps().size(); ++k) s = test::euler_step(s, tau_, rate);
        return s;
    }

 private:
    Values random(double low, double high) {
        Values out(oracle_.size());
        for (double& v : out) v = static_cast<float>(low + (high - low) * make_.uniform());
        return out;
    }
    std::vector<float> bricks(const Values& values, float absent) const {
        std::vector<float> out(layout_.brick_count() * 512);
        test::to_bricks(layout_, oracle_, values, absent, out.data());
        return out;
    }
    SweepField field(std::size_t i, ShiftedField* now, ShiftedField* before) const {
        const FieldCase& f = case_.fields[i];
        SweepField out;
        for (std::size_t t = 0; t < f.orders.size(); ++t)
            out.terms.push_back(
                {f.orders[t], f.variable[t] ? d_bricks_[i][t].data() : nullptr, f.factors[t]});
        out.state = now;
        out.before = before;
        out.coupling = f.coupling;
        out.target = f.target ? target_bricks_[i].data() : nullptr;
        return out;
    }

    Case case_;
    BlockLayout layout_;
    Oracle oracle_;
    test::SparseMaker make_;
    State start_;
    std::vector<Values> target_;
    std::vector<std::vector<float>> target_bricks_;
    std::vector<std::vector<Values>> d_;
    std::vector<std::vector<std::vector<float>>> d_bricks_;
    double tau_ = 0;
};

FieldCase one(int order, bool variable) { return {{order}, {variable}, {1.0}, 0, false}; }

std::vector<Case> cases() {
    const Vec3d ones = Vec3d::Ones(), flat(1, 0.36, 0.09);
    return {
        {"q0", {one(0, false)}, {5, 3, 5}, true, ones},
        {"q0 variable", {one(0, true)}, {1, 5, 2, 1}, true, ones},
        {"q1", {one(1, true)}, {3, 3}, true, ones},
        {"q1 constant", {one(1, false)}, {3, 1, 2}, true, flat},
        {"q2", {one(2, true)}, {2, 1, 2, 2}, true, ones},
        {"q3", {one(3, true)}, {1, 1, 1}, true, flat},
        {"q5", {one(5, true)}, {1, 2}, true, ones},
        {"one step", {one(0, true)}, {1}, true, ones},
        {"wide halo", {one(0, true)}, {32}, true, ones},
        {"euler", {one(1, true)}, {3, 2, 3}, false, ones},
        {"sum", {{{0, 2}, {true, true}, {1.0, 0.1}, 0, false}}, {2, 2}, true, ones},
        {"sum of three", {{{0, 1, 3}, {true, false, true}, {1.0, 0.2, 0.01}, 0.3, true}}, {2, 1}, true, flat},
        {"fidelity", {{{1}, {true}, {2.5}, 4, true}}, {3, 2}, true, ones},
        {"fidelity, constant", {{{0}, {false}, {0.5}, 1.5, true}}, {4, 4}, false, ones},
        {"coupled",
         {{{0}, {true}, {0.1}, 1.0, false}, {{0}, {true}, {1.0}, 2.0, false}},
         {5, 2, 4},
         true,
         ones},
        {"coupled orders",
         {{{0}, {false}, {0.3}, 1.0, false}, {{0, 1}, {true, false}, {1.0, 0.2}, 0.7, false}},
         {3, 2},
         true,
         flat},
        {"coupled one way",
         {{{1}, {true}, {1.0}, 1.0, true}, {{0}, {true}, {1.0}, 3.0, false}},
         {2, 2, 2},
         true,
         ones},
        {"two on their own", {one(1, true), one(0, false)}, {3, 1}, true, ones},
    };
}

class SweepOn : public testing::TestWithParam<std::string> {};

TEST_P(SweepOn, AgreesWithTheOracle) {
    const auto grid = test::sparse_grid(GetParam(), 5);
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        const Setting setting(*grid, c);
        const auto values = setting.run();
        const State expected = setting.expected();
        for (std::size_t i = 0; i < values.size(); ++i)
            EXPECT_LT(
                test::largest_difference(setting.layout(), values[i].data(), setting.oracle(), expected[i]),
                2e-6)
                << "field " << i;
    }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, SweepOn, testing::ValuesIn(test::sparse_kinds()), name_of);

TEST(Sweep, GivesTheSameBitsForAnyNumberOfThreads) {
    for (const std::string kind : {"cells", "shell"}) {
        const auto grid = test::sparse_grid(kind, 9);
        for (const Case& c : cases()) {
            SCOPED_TRACE(kind + ", " + c.name);
            const Setting setting(*grid, c);
            std::vector<std::vector<float>> first;
            test::with_threads(1, [&] { first = setting.run(); });
            for (const std::size_t threads : {2, 4})
                test::with_threads(threads, [&] {
                    const auto again = setting.run();
                    for (std::size_t i = 0; i < first.size(); ++i)
                        EXPECT_EQ(
                            std::memcmp(first[i].data(), again[i].data(), first[i].size() * sizeof(float)),
                            0);
                });
        }
    }
}

/// Boxes that begin and end anywhere in leaves and cells.
TEST(Sweep, OfAPartIsWhatItIsOfAll) {
    using openvdb::Coord;
    using openvdb::CoordBBox;
    for (const std::string kind : {"cells", "shell"}) {
        const auto grid = test::sparse_grid(kind, 9);
        const CoordBBox all = grid->evalActiveVoxelBoundingBox();
        const Coord middle((all.min().x() + all.max().x()) / 2, (all.min().y() + all.max().y()) / 2,
                           (all.min().z() + all.max().z()) / 2);
        for (const Case& c : cases()) {
            SCOPED_TRACE(kind + ", " + c.name);
            const Setting setting(*grid, c);
            const auto whole = setting.run();
            for (const CoordBBox& box :
                 {CoordBBox(all.min(), middle), CoordBBox(middle, all.max()),
                  CoordBBox(middle.offsetBy(-13, -9, -41), middle.offsetBy(6, 11, 30)),
                  CoordBBox(Coord(all.min().x(), middle.y() & ~7, all.min().z()), all.max())}) {
                const auto part = setting.run(box);
                const BlockLayout& layout = setting.layout();
                std::uint64_t different = 0, seen = 0;
                for (std::size_t b = 0; b < layout.brick_count(); ++b)
                    for (int k = 0; k < 512; ++k) {
                        if (!test::is_active(layout, b, k) || !box.isInside(test::voxel_of(layout, b, k)))
                            continue;
                        const std::size_t at = b * 512 + static_cast<std::size_t>(k);
                        ++seen;
                        for (std::size_t i = 0; i < whole.size(); ++i)
                            different += std::memcmp(&whole[i][at], &part[i][at], sizeof(float)) != 0;
                    }
                EXPECT_EQ(different, 0u) << box;
                EXPECT_GT(seen, 50u) << box;
            }
        }
    }
}

/// Long runs of cells along x and many slabs: dense, so that every tile's border is met.
TEST(Sweep, KnowsNoTileBorders) {
    const auto grid = test::box_grid(test::box_of(openvdb::Coord(-70, -35, -5), 290, 80, 20),
                                     [](const openvdb::Coord& c) { return c.x(); });
    for (const Case& c : cases()) {
        if (c.name != "q0 variable" && c.name != "q2") continue;
        SCOPED_TRACE(c.name);
        const Setting setting(*grid, c);
        const auto values = setting.run();
        EXPECT_LT(test::largest_difference(setting.layout(), values[0].data(), setting.oracle(),
                                           setting.expected()[0]),
                  2e-6);
    }
}

TEST(Sweep, RefusesAnOrderThatNoTileHolds) {
    const auto grid = test::sparse_grid("one voxel", 1);
    const Case c{"q12", {one(12, true)}, {3}, true, Vec3d::Ones()};
    EXPECT_THROW(Setting(*grid, c).run(), InvalidInput);
}

TEST(Sweep, DoesAsManyStepsAsATileHolds) {
    for (int order = 0; order <= 15; ++order) {
        EXPECT_GE(stencil::steps_per_sweep(order), 1);
        EXPECT_LE(stencil::steps_per_sweep(order) * (order + 1), BlockLayout::max_halo);
    }
}

TEST(Sweep, OfNothingDoesNothing) {
    const auto grid = test::empty_grid();
    const Case c{"q1", {one(1, true)}, {3, 3}, true, Vec3d::Ones()};
    const auto values = Setting(*grid, c).run();
    EXPECT_TRUE(values[0].empty());
}

}  // namespace
}  // namespace vdbgeo
