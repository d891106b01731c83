// What is diffused in parts, and how.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <string>
#include <vector>

#include "tests/support/grids.h"
#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo::test {

inline const openvdb::CoordBBox noisy_box(openvdb::Coord(-20, -40, -60), openvdb::Coord(90, 110, 200));

/// A dense ball in noise, with a hole where nothing is active and sparse leaves around it.
inline openvdb::FloatGrid::Ptr noisy_map(const openvdb::CoordBBox& box = noisy_box) {
    SparseMaker make(7);
    auto grid = make.grid();
    auto to = grid->getAccessor();
    for (auto c = box.begin(); c; ++c) {
        const openvdb::Coord at = *c;
        const Vec3d p(at.x() - 30, at.y() - 35, 0.6 * (at.z() - 70));
        const double r = p.norm();
        if (r > 75 || (r < 12 && at.x() > 30)) continue;
        if (r > 68 && make.uniform() < 0.5) continue;
        to.setValueOn(at, static_cast<float>((r < 45 ? 1 : 0) + make.uniform() - 0.5 + 10));
    }
    return grid;
}

struct DiffusionSetting {
    const char* name;
    HyperdiffusionOptions options;
};

inline std::vector<DiffusionSetting> diffusion_settings() {
    const auto with = [](int order, const std::string& sigma) {
        HyperdiffusionOptions o;
        o.terms = {{order, 1.0}};
        o.sigma = EdgeScale::parse(sigma);
        o.steps = order == 0 ? 40 : 22;
        return o;
    };
    std::vector<DiffusionSetting> all{{"q0 local", with(0, "local")},      {"q0 global", with(0, "global")},
                                      {"q1 local:3", with(1, "local:3")},  {"q1 global", with(1, "global")},
                                      {"q2 local:8", with(2, "local:8")},  {"q2 inf", with(2, "inf")},
                                      {"q1 until done", with(1, "global")}};
    all.back().options.steps.reset();
    all.push_back({"q0+q1 euler, fidelity", with(1, "local")});
    all.back().options.terms = {{0, 0.5}, {1, 1.0}};
    all.back().options.stepper = Stepper::euler;
    all.back().options.steps = 7;
    all.back().options.fidelity = 0.1;
    return all;
}

/// For the names of tests: letters and digits.
inline std::string name_of_setting(const ::testing::TestParamInfo<DiffusionSetting>& info) {
    std::string name;
    for (const char c : std::string(info.param.name)) name += std::isalnum(c) ? c : '_';
    return name;
}

}  // namespace vdbgeo::test
