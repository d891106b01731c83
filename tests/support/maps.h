// Small maps made in code.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "vdbgeo/volume/grid_builder.h"

namespace vdbgeo::test {

/// A dense map of the given size from values in x-fastest order.
inline DensityMap map_from_values(const Vec3i& size, const std::vector<float>& values,
                                  const Frame& frame = {}, const SparsifyOptions& options = {}) {
    GridBuilder builder(size, {0, 1, 2}, options);
    builder.add_sections(values.data(), size.z());
    return builder.finish(frame);
}

/// A dense map that samples f(x, y, z) at the world positions of the frame.
inline DensityMap map_from_function(const Vec3i& size, const Frame& frame,
                                    const std::function<double(const Vec3d&)>& f,
                                    const SparsifyOptions& options = {}) {
    std::vector<float> values;
    values.reserve(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
                   static_cast<std::size_t>(size.z()));
    for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
            for (int x = 0; x < size.x(); ++x)
                values.push_back(static_cast<float>(f(frame.to_world(Vec3d(x, y, z)))));
    return map_from_values(size, values, frame, options);
}

/// A cube of n³ voxels of size h, centred at the world's origin.
inline Frame centred_frame(int n, double h) {
    Frame frame;
    frame.axes = h * Mat3d::Identity();
    frame.origin = Vec3d::Constant(-0.5 * h * (n - 1));
    return frame;
}

/// White noise in [-1, 1), the same on every machine.
inline std::vector<float> noise(std::size_t count, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<float> values(count);
    for (float& v : values) v = static_cast<float>(static_cast<double>(random() >> 11) * 0x1p-52 - 1);
    return values;
}

}  // namespace vdbgeo::test
