// Rays against the triangles of a model, by embree. Used by render only; empty in builds without embree.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "vdbgeo/core/tri_mesh.h"

struct RTCDeviceTy;
struct RTCSceneTy;

namespace vdbgeo {

/// Embree's device and scene over copies of a model's points and triangles. Queries may come from any thread.
class RayCaster {
 public:
    /// Throws NumericalError where embree cannot be started or takes no such scene.
    RayCaster(const Array<Vec3f>& points, const Array<Triangle>& triangles);
    ~RayCaster();
    RayCaster(const RayCaster&) = delete;
    RayCaster& operator=(const RayCaster&) = delete;

    struct Hit {
        std::uint32_t face;
        float distance, u, v;
    };

    /// What a ray meets first, if anything.
    std::optional<Hit> first(const Vec3f& origin, const Vec3f& direction) const;

    static constexpr int packet = 8;

    /// For each of `count` ≤ packet rays from one point, whether it meets something before its length.
    std::array<bool, packet> blocked(const Vec3f& origin, const Vec3f* directions, const float* lengths,
                                     int count) const;

 private:
    void release();

    RTCDeviceTy* device_;
    RTCSceneTy* scene_ = nullptr;
};

}  // namespace vdbgeo
