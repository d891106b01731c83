// Small types that every part of vdbgeo shares.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cstdint>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace vdbgeo {

using Vec3f = Eigen::Vector3f;
using Vec3d = Eigen::Vector3d;
using Vec3i = Eigen::Vector3i;
using Mat3d = Eigen::Matrix3d;

/// Allocator whose `resize` leaves trivial elements uninitialised: large arrays are then first touched by
/// the threads that fill them, in parallel, and not twice.
template <class T>
struct UninitializedAllocator : std::allocator<T> {
    template <class U>
    struct rebind {
        using other = UninitializedAllocator<U>;
    };
    using std::allocator<T>::allocator;

    template <class U>
    void construct(U* p) noexcept(noexcept(::new (static_cast<void*>(p)) U)) {
        ::new (static_cast<void*>(p)) U;
    }
    template <class U, class... Args>
    void construct(U* p, Args&&... args) {
        ::new (static_cast<void*>(p)) U(std::forward<Args>(args)...);
    }
};

/// A std::vector for bulk data; `resize` does not initialise trivial elements.
template <class T>
using Array = std::vector<T, UninitializedAllocator<T>>;

}  // namespace vdbgeo
