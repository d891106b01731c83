// Fields in the bricks of a layout, from the oracle's lists and back.
#pragma once

#include <functional>
#include <vector>

#include "tests/support/dense_oracle.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::test {

inline openvdb::Coord voxel_of(const stencil::BlockLayout& layout, std::size_t brick, int k) {
    return layout.origin(brick).offsetBy(k >> 6, k >> 3 & 7, k & 7);
}

inline bool is_active(const stencil::BlockLayout& layout, std::size_t brick, int k) {
    return layout.mask(brick)[static_cast<std::size_t>(k >> 6)] >> (k & 63) & 1;
}

/// Writes the values into the bricks, `absent` where there is no active voxel.
inline void to_bricks(const stencil::BlockLayout& layout, const Oracle& oracle, const Values& values,
                      float absent, float* bricks) {
    for (std::size_t b = 0; b < layout.brick_count(); ++b)
        for (int k = 0; k < 512; ++k) {
            const int n = oracle.number(voxel_of(layout, b, k));
            bricks[b * 512 + static_cast<std::size_t>(k)] =
                n == Oracle::none ? absent : static_cast<float>(values[static_cast<std::size_t>(n)]);
        }
}

/// The largest |bricks − expected|; inactive voxels are expected to hold 0.
inline double largest_difference(const stencil::BlockLayout& layout, const float* bricks,
                                 const Oracle& oracle, const Values& expected) {
    double most = 0;
    for (std::size_t b = 0; b < layout.brick_count(); ++b)
        for (int k = 0; k < 512; ++k) {
            const int n = oracle.number(voxel_of(layout, b, k));
            const double difference =
                std::abs(bricks[b * 512 + static_cast<std::size_t>(k)] -
                         (n == Oracle::none ? 0 : expected[static_cast<std::size_t>(n)]));
            if (!(difference <= most)) most = difference;
        }
    return most;
}

}  // namespace vdbgeo::test
