// One number a voxel over the bricks of a BlockLayout.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <limits>
#include <memory>

#include "vdbgeo/core/exact_sum.h"
#include "vdbgeo/core/team.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

/// Floats for a number of bricks, on memory that is aligned to cache lines, and to huge pages where it is
/// large enough for them. Not initialised. Moves, does not copy.
class BlockField {
 public:
    static constexpr std::size_t brick_size = 512;

    BlockField() = default;
    explicit BlockField(std::size_t bricks);

    bool empty() const { return !data_; }
    std::size_t bricks() const { return bricks_; }
    float* brick(std::size_t i) { return data_.get() + i * brick_size; }
    const float* brick(std::size_t i) const { return data_.get() + i * brick_size; }
    std::size_t memory() const { return bricks_ * brick_size * sizeof(float); }

    /// As long as one of these lives, memory that fields give back is kept for the next: for who makes fields
    /// of about the same sizes again and again, which would cost as much as using them. What is kept is given
    /// back once a field does not fit into any of it. Of one thread at a time.
    class Reuse {
     public:
        Reuse();
        ~Reuse();
        Reuse(const Reuse&) = delete;
        Reuse& operator=(const Reuse&) = delete;
    };

 private:
    struct Free {
        Free() : bytes(0) {}
        explicit Free(std::size_t size) : bytes(size) {}
        void operator()(float* p) const;
        std::size_t bytes;
    };
    std::unique_ptr<float[], Free> data_;
    std::size_t bricks_ = 0;
};

/// What a field holds in its active voxels. Sums are exact but for those of a brick, which are in double.
struct FieldSummary {
    double sum = 0, sum_of_squares = 0;
    float min = 0, max = 0;  ///< 0 without voxels; of the finite values
    std::uint64_t count = 0, non_finite = 0;
    double mean() const { return count ? sum / static_cast<double>(count) : 0; }
    /// Variance of the values, ≥ 0.
    double variance() const;
};

/// A field as it is in memory: brick i of the layout at `bricks` + 512 i. Over the bricks that the layout
/// works on, of all members where there is a team; the same bits however they are shared out.
FieldSummary summarize(const BlockLayout& layout, const float* bricks, Team* team = nullptr);

/// The same of a field that comes in parts, in any order.
class FieldTotal {
 public:
    void add(const BlockLayout& layout, const float* bricks);
    void add(const FieldTotal& other);
    FieldSummary summary(Team* team = nullptr) const;

 private:
    void add_brick(const BlockLayout::Mask& mask, const float* values);
    void add_sparse_brick(const BlockLayout::Mask& mask, const float* values);

    ExactSum sum_, squares_;
    float min_ = std::numeric_limits<float>::infinity(), max_ = -std::numeric_limits<float>::infinity();
    std::uint64_t count_ = 0, non_finite_ = 0;
};

/// A number that tells this field, and where it lies, from others: of the bricks that the layout works on, to
/// be added up over the parts of a grid (it wraps around).
std::uint64_t hash_of_bricks(const BlockLayout& layout, const float* bricks);

/// Σ (a − b)² over the active voxels that the layout works on.
double squared_distance(const BlockLayout& layout, const float* a, const float* b, Team* team = nullptr);

/// out = value − offset in the active voxels, 0 in the others. The tree has the layout's leaves.
void load(const BlockLayout& layout, const openvdb::FloatTree& tree, float offset, float* out);

/// Writes value + offset into the active voxels of the layout's leaves of the tree.
void store(const BlockLayout& layout, const float* bricks, float offset, openvdb::FloatTree& tree);

}  // namespace vdbgeo::stencil
