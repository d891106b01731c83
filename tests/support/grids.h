// Small grids for the tests of operators: masks of every shape that leaves can have, with noise in them.
#pragma once

#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <cstdint>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo::test {

/// What inactive voxels hold: operators must neither read nor change it.
constexpr float untouched = -777.25f;

/// Runs body with at most `threads` threads.
template <class Body>
void with_threads(std::size_t threads, const Body& body) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    body();
}

inline openvdb::FloatGrid::Ptr empty_grid() { return openvdb::FloatGrid::create(untouched); }

/// Fills the box with f(x, y, z).
inline openvdb::FloatGrid::Ptr box_grid(const openvdb::CoordBBox& box,
                                        const std::function<double(const openvdb::Coord&)>& f) {
    auto grid = empty_grid();
    auto accessor = grid->getAccessor();
    for (auto c = box.begin(); c; ++c) accessor.setValueOn(*c, static_cast<float>(f(*c)));
    return grid;
}

inline openvdb::CoordBBox box_of(const openvdb::Coord& origin, int nx, int ny, int nz) {
    return {origin, origin.offsetBy(nx - 1, ny - 1, nz - 1)};
}

/// The kinds of masks that `sparse_grid` makes.
inline const std::vector<std::string>& sparse_kinds() {
    static const std::vector<std::string> kinds{"one voxel",  "inside a leaf", "leaf corner", "row",
                                                "few leaves", "cells",         "shell",       "far apart"};
    return kinds;
}

class SparseMaker {
 public:
    explicit SparseMaker(std::uint64_t seed)
        : random_(seed), grid_(empty_grid()), to_(grid_->getAccessor()) {}

    double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
    int below(int n) { return static_cast<int>(uniform() * n); }
    void set(const openvdb::Coord& c) { to_.setValueOn(c, static_cast<float>(2 * uniform() - 1)); }
    /// Each voxel of the box with the given probability.
    void fill(const openvdb::CoordBBox& box, double density) {
        for (auto c = box.begin(); c; ++c)
            if (uniform() < density) set(*c);
    }
    /// A leaf, dense or sparse.
    void leaf(const openvdb::Coord& origin) {
        const double densities[] = {1, 0.9, 0.5, 0.05};
        fill(openvdb::CoordBBox::createCube(origin, 8), densities[below(4)]);
    }
    openvdb::FloatGrid::Ptr grid() { return grid_; }

 private:
    std::mt19937_64 random_;
    openvdb::FloatGrid::Ptr grid_;
    openvdb::FloatGrid::Accessor to_;
};

/// Noise in [−1, 1) on a mask of the kind, at negative coordinates too.
inline openvdb::FloatGrid::Ptr sparse_grid(const std::string& kind, std::uint64_t seed) {
    using openvdb::Coord;
    SparseMaker make(seed);
    if (kind == "one voxel") make.set(Coord(-1, 31, 64));
    if (kind == "inside a leaf") make.fill(box_of(Coord(-6, 2, 2), 4, 5, 3), 0.8);
    if (kind == "leaf corner")  // the corner of eight cells too
        make.fill(box_of(Coord(-2, 30, 61), 4, 5, 6), 0.85);
    if (kind == "row") make.fill(box_of(Coord(-40, -1, 63), 90, 2, 1), 0.95);
    if (kind == "few leaves")
        for (int i = 1 + make.below(12); i > 0; --i)
            make.leaf(Coord(8 * (make.below(4) - 2), 8 * (make.below(4) - 2), 8 * (make.below(4) - 2)));
    if (kind == "cells")
        for (int i = 0; i < 40; ++i)
            make.leaf(Coord(8 * (make.below(10) - 5), 8 * (make.below(12) - 5), 8 * (make.below(6) - 3)));
    if (kind == "shell")
        for (auto c = openvdb::CoordBBox(Coord(-14), Coord(14)).begin(); c; ++c) {
            const double r = (*c).asVec3d().length();
            if (r > 9.5 && r < 13) make.set(*c);
        }
    if (kind == "far apart")
        for (int i = 0; i < 6; ++i) {
            const int far = i % 3 == 0 ? 0 : i % 3 == 1 ? 1 << 20 : -(1 << 17);
            make.leaf(Coord(far + 8 * make.below(3), 8 * make.below(3) - far, 64 * make.below(2) + far));
        }
    return make.grid();
}

/// The bits of all values, active or not, of all leaves, and where they are.
inline std::vector<std::uint32_t> bits_of(const openvdb::FloatGrid& grid) {
    std::vector<std::uint32_t> out;
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
        for (int a = 0; a < 3; ++a) out.push_back(static_cast<std::uint32_t>(leaf->origin()[a]));
        const std::size_t at = out.size();
        out.resize(at + 512);
        std::memcpy(&out[at], leaf->buffer().data(), 512 * sizeof(float));
    }
    return out;
}

/// Whether every inactive value in the leaves is what it was.
inline bool inactive_untouched(const openvdb::FloatGrid& grid) {
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
        for (auto it = leaf->cbeginValueOff(); it; ++it)
            if (*it != untouched) return false;
    return true;
}

}  // namespace vdbgeo::test
