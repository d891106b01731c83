#include "converters/dense_sections.h"

#include <algorithm>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

constexpr int leaf = 8;

int leaf_start(int index) { return index & ~(leaf - 1); }

// Indices in memory of a leaf's samples differ by this much from one to the next along x, y, z.
constexpr std::array<int, 3> leaf_step{64, 8, 1};

}  // namespace

DenseSections::DenseSections(const openvdb::FloatGrid& grid, const Vec3i& first, const Vec3i& size,
                             const std::array<int, 3>& order)
    : DenseSections(
          [&grid] {
              return LeafLookup(
                  [accessor = grid.getConstAccessor()](const openvdb::Coord& corner, float& tile) {
                      const auto* node = accessor.probeConstLeaf(corner);
                      if (!node) tile = accessor.getValue(corner);
                      return node ? node->buffer().data() : nullptr;
                  });
          },
          first, size, order) {}

int DenseSections::piece(int section) const {
    const int start = first_[order_[2]] + section;
    return std::min(leaf_start(start) + leaf - start, size_[order_[2]] - section);
}

std::size_t DenseSections::largest_piece() const {
    return static_cast<std::size_t>(size_[order_[0]]) * static_cast<std::size_t>(size_[order_[1]]) *
           static_cast<std::size_t>(std::min(leaf, size_[order_[2]]));
}

void DenseSections::fill(int section, float* out) const {
    const int begin = leaf_start(first_[order_[1]]), end = first_[order_[1]] + size_[order_[1]];
    // Asked for here, outside of the loop, so that a source that reads by slabs reads on all threads.
    openvdb::Coord corner;
    corner[order_[0]] = leaf_start(first_[order_[0]]), corner[order_[1]] = begin;
    corner[order_[2]] = leaf_start(first_[order_[2]] + section);
    float tile = 0;
    leaves_()(corner, tile);
    parallel_for(static_cast<std::size_t>((end - begin + leaf - 1) / leaf), 1, [&](std::size_t i) {
        fill_row_of_leaves(section, begin + leaf * static_cast<int>(i), out);
    });
}

void DenseSections::fill_row_of_leaves(int section, int row_leaf, float* out) const {
    const int c = order_[0], r = order_[1], s = order_[2];
    const auto step = [&](int axis) { return leaf_step[static_cast<std::size_t>(axis)]; };
    const std::ptrdiff_t columns = size_[c], rows = size_[r];
    const int s_begin = first_[s] + section, s_end = s_begin + piece(section);
    const int r_begin = std::max(row_leaf, first_[r]),
              r_end = std::min(row_leaf + leaf, first_[r] + size_[r]);
    const LeafLookup lookup = leaves_();
    for (int column_leaf = leaf_start(first_[c]); column_leaf < first_[c] + size_[c]; column_leaf += leaf) {
        const int c_begin = std::max(column_leaf, first_[c]);
        const int c_end = std::min(column_leaf + leaf, first_[c] + size_[c]);
        openvdb::Coord corner;
        corner[c] = column_leaf, corner[r] = row_leaf, corner[s] = leaf_start(s_begin);
        float tile = 0;
        const float* values = lookup(corner, tile);
        for (int si = s_begin; si < s_end; ++si)
            for (int ri = r_begin; ri < r_end; ++ri) {
                float* to =
                    out + ((si - s_begin) * rows + (ri - first_[r])) * columns + (c_begin - first_[c]);
                if (!values) {
                    std::fill_n(to, c_end - c_begin, tile);
                    continue;
                }
                const float* from = values + (si - corner[s]) * step(s) + (ri - corner[r]) * step(r);
                for (int ci = c_begin; ci < c_end; ++ci) *to++ = from[(ci - corner[c]) * step(c)];
            }
    }
}

}  // namespace vdbgeo
