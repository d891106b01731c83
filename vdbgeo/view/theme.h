// The colours of paper and ink in pictures and plots.
#pragma once

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// sRGB. Words, axes and bars are drawn in ink on paper, grid lines are faint.
struct Theme {
    Vec3f paper, ink, faint;

    static Theme light() { return {Vec3f::Ones(), Vec3f::Constant(0.13f), Vec3f::Constant(0.87f)}; }
    static Theme dark() {
        return {Vec3f(0.075f, 0.082f, 0.098f), Vec3f::Constant(0.88f), Vec3f::Constant(0.23f)};
    }
};

}  // namespace vdbgeo
