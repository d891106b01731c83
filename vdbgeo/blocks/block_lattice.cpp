#include "vdbgeo/blocks/block_lattice.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

std::int64_t floor_to(std::int64_t value, std::int64_t step) {
    return value >= 0 ? value / step * step : -((-value + step - 1) / step * step);
}

CoordBBox grown(const CoordBBox& box, const Coord& step) {
    CoordBBox out;
    if (box.empty()) return out;
    for (int a = 0; a < 3; ++a) {
        out.min()[a] = static_cast<int>(floor_to(box.min()[a], step[a]));
        const std::int64_t end = floor_to(std::int64_t{box.max()[a]} + step[a], step[a]);
        out.max()[a] = static_cast<int>(end - 1);
    }
    return out;
}

std::int64_t length(const CoordBBox& box, int axis) {
    return std::int64_t{box.max()[axis]} - box.min()[axis] + 1;
}

std::int64_t round_up(std::int64_t value, std::int64_t step) { return (value + step - 1) / step * step; }

double volume(const std::array<double, 3>& lengths) { return lengths[0] * lengths[1] * lengths[2]; }

}  // namespace

BlockLattice::BlockLattice(const CoordBBox& box, const Coord& extent, const BlockRules& rules)
    : box_(grown(box, rules.step)), extent_(extent), rules_(rules) {
    for (int a = 0; a < 3; ++a)
        if (extent[a] < 1 || extent[a] % rules.step[a] != 0)
            throw InvalidInput("the blocks' size is no multiple of what they have to be a multiple of");
    if (box_.empty()) return;
    double blocks = 1;
    for (int a = 0; a < 3; ++a) {
        count_[a] = static_cast<int>((length(box_, a) + extent[a] - 1) / extent[a]);
        blocks *= count_[a];
    }
    constexpr double most = 1 << 20;
    if (blocks > most)
        throw NumericalError("the map would be cut into more than a million blocks; allow more --memory");
}

BlockLattice BlockLattice::of_volume(const CoordBBox& box, double voxels, const BlockRules& rules) {
    const CoordBBox all = grown(box, rules.step);
    if (all.empty()) return {box, rules.step, rules};
    std::array<std::int64_t, 3> extent{};
    for (int a = 0; a < 3; ++a) extent[static_cast<std::size_t>(a)] = length(all, a);
    // With what is read around it where there is a neighbour.
    const auto read_with = [&](std::size_t a) {
        const std::int64_t whole = length(all, static_cast<int>(a));
        return static_cast<double>(std::min(extent[a] + rules.below + rules.above, whole));
    };
    const auto fits = [&] { return volume({read_with(0), read_with(1), read_with(2)}) <= voxels; };
    for (const std::int64_t thin : {64, 8})
        for (int k = 2; k >= 0; --k) {
            const auto a = static_cast<std::size_t>(rules.order[static_cast<std::size_t>(k)]);
            const std::int64_t step = rules.step[static_cast<int>(a)],
                               whole = length(all, static_cast<int>(a)), least = round_up(thin, step);
            for (std::int64_t parts = 2; !fits() && extent[a] > least; ++parts)
                extent[a] = std::max(least, round_up((whole + parts - 1) / parts, step));
            if (fits())
                return {box,
                        Coord(static_cast<int>(extent[0]), static_cast<int>(extent[1]),
                              static_cast<int>(extent[2])),
                        rules};
        }
    throw NumericalError("the memory allowed does not suffice for the smallest block; allow more --memory");
}

std::size_t BlockLattice::size() const {
    return static_cast<std::size_t>(count_.x()) * static_cast<std::size_t>(count_.y()) *
           static_cast<std::size_t>(count_.z());
}

Coord BlockLattice::place(std::size_t n) const {
    Coord place;
    for (const int a : rules_.order) {
        const auto count = static_cast<std::size_t>(count_[a]);
        place[a] = static_cast<int>(n % count);
        n /= count;
    }
    return place;
}

std::size_t BlockLattice::at(const Coord& place) const {
    std::size_t n = 0;
    for (int k = 2; k >= 0; --k) {
        const int a = rules_.order[static_cast<std::size_t>(k)];
        n = n * static_cast<std::size_t>(count_[a]) + static_cast<std::size_t>(place[a]);
    }
    return n;
}

CoordBBox BlockLattice::block(std::size_t n) const {
    const Coord at = place(n);
    CoordBBox out;
    for (int a = 0; a < 3; ++a) {
        out.min()[a] = box_.min()[a] + at[a] * extent_[a];
        out.max()[a] = static_cast<int>(
            std::min(std::int64_t{out.min()[a]} + extent_[a] - 1, std::int64_t{box_.max()[a]}));
    }
    return out;
}

CoordBBox BlockLattice::wanted(std::size_t n) const {
    CoordBBox out = block(n);
    for (int a = 0; a < 3; ++a) {
        out.min()[a] = static_cast<int>(
            std::max(std::int64_t{out.min()[a]} - rules_.below, std::int64_t{box_.min()[a]}));
        out.max()[a] = static_cast<int>(
            std::min(std::int64_t{out.max()[a]} + rules_.above, std::int64_t{box_.max()[a]}));
    }
    return out;
}

CoordBBox BlockLattice::without_border(std::size_t n) const {
    CoordBBox out = block(n);
    for (int a = 0; a < 3; ++a) {
        if (out.min()[a] == box_.min()[a]) out.min()[a] = std::numeric_limits<int>::min();
        if (out.max()[a] == box_.max()[a]) out.max()[a] = std::numeric_limits<int>::max();
    }
    return out;
}

double BlockLattice::largest() const {
    if (size() == 0) return 0;
    double voxels = 1;
    for (int a = 0; a < 3; ++a)
        voxels *= static_cast<double>(std::min(
            std::int64_t{extent_[a]} + (count_[a] > 1 ? rules_.below + rules_.above : 0), length(box_, a)));
    return voxels;
}

}  // namespace vdbgeo
