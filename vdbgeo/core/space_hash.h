// Things numbered by the cube of space they are in, so that neighbours are found in constant time.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Numbers kept by the cube of space they are in. Lists are in the order of adding.
class SpaceHash {
 public:
    explicit SpaceHash(double side) : scale_(1 / side) {}

    using Cell = std::array<std::int64_t, 3>;
    Cell cell(const Vec3d& p) const {
        Cell c;
        for (int a = 0; a < 3; ++a)
            c[static_cast<std::size_t>(a)] = static_cast<std::int64_t>(std::floor(p[a] * scale_));
        return c;
    }
    void add(const Vec3d& p, std::uint32_t number) { cells_[cell(p)].push_back(number); }
    /// Calls visit(number) for all in the cubes around p, itself included, until it returns true.
    template <class Visit>
    bool near(const Vec3d& p, const Visit& visit) const {
        const Cell c = cell(p);
        for (std::int64_t i = -1; i <= 1; ++i)
            for (std::int64_t j = -1; j <= 1; ++j)
                for (std::int64_t k = -1; k <= 1; ++k) {
                    const auto found = cells_.find({c[0] + i, c[1] + j, c[2] + k});
                    if (found == cells_.end()) continue;
                    for (const std::uint32_t n : found->second)
                        if (visit(n)) return true;
                }
        return false;
    }

 private:
    struct Hash {
        std::size_t operator()(const Cell& c) const {
            std::uint64_t h = 0;
            for (const std::int64_t number : c) {  // each one is mixed in whole: cells lie on lattices
                h = (h ^ static_cast<std::uint64_t>(number)) * 0x9E3779B97F4A7C15ull;
                h ^= h >> 32;
            }
            return static_cast<std::size_t>(h);
        }
    };
    double scale_;
    std::unordered_map<Cell, std::vector<std::uint32_t>, Hash> cells_;
};

}  // namespace vdbgeo
