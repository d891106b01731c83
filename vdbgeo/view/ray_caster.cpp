#include "vdbgeo/view/ray_caster.h"

#ifdef VDBGEO_HAS_EMBREE
#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

void set(RTCRay& ray, const Vec3f& origin, const Vec3f& direction, float length) {
    ray.org_x = origin.x(), ray.org_y = origin.y(), ray.org_z = origin.z();
    ray.dir_x = direction.x(), ray.dir_y = direction.y(), ray.dir_z = direction.z();
    ray.tfar = length;
    ray.mask = ~0u;
}

}  // namespace

RayCaster::RayCaster(const Array<Vec3f>& points, const Array<Triangle>& triangles)
    : device_(rtcNewDevice(nullptr)) {
    if (!device_) throw NumericalError("the ray caster (embree) could not be started");
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    // Embree reads 16 bytes at each point: its own, padded buffer has them.
    void* own_points = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                               sizeof(Vec3f), points.size());
    void* own_faces = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              sizeof(Triangle), triangles.size());
    if (own_points && own_faces) {
        std::copy(points.begin(), points.end(), static_cast<Vec3f*>(own_points));
        std::copy(triangles.begin(), triangles.end(), static_cast<Triangle*>(own_faces));
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_, geometry);
        rtcCommitScene(scene_);
    }
    rtcReleaseGeometry(geometry);
    const RTCError error = rtcGetDeviceError(device_);
    if (error != RTC_ERROR_NONE) {
        release();
        throw NumericalError(fmt::format("the ray caster (embree) failed on {} faces, error {}",
                                         triangles.size(), static_cast<int>(error)));
    }
}

RayCaster::~RayCaster() { release(); }

void RayCaster::release() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
}

std::optional<RayCaster::Hit> RayCaster::first(const Vec3f& origin, const Vec3f& direction) const {
    RTCRayHit query{};
    set(query.ray, origin, direction, std::numeric_limits<float>::infinity());
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_, &context, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    return Hit{query.hit.primID, query.ray.tfar, query.hit.u, query.hit.v};
}

std::array<bool, RayCaster::packet> RayCaster::blocked(const Vec3f& origin, const Vec3f* directions,
                                                       const float* lengths, int count) const {
    RTCRay8 rays{};
    alignas(32) int valid[packet];
    for (int i = 0; i < packet; ++i) {
        const int k = std::min(i, count - 1);
        valid[i] = i < count ? -1 : 0;
        rays.org_x[i] = origin.x(), rays.org_y[i] = origin.y(), rays.org_z[i] = origin.z();
        rays.dir_x[i] = directions[k].x(), rays.dir_y[i] = directions[k].y(),
        rays.dir_z[i] = directions[k].z();
        rays.tfar[i] = lengths[k];
        rays.mask[i] = ~0u;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded8(valid, scene_, &context, &rays);
    std::array<bool, packet> result{};
    for (int i = 0; i < count; ++i) result[static_cast<std::size_t>(i)] = rays.tfar[i] < 0;
    return result;
}

}  // namespace vdbgeo

#endif
