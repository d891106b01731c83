#include "vdbgeo/stencil/block_field.h"

#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <mutex>
#include <new>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/file_hash.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo::stencil {
namespace {

constexpr std::size_t huge_page = std::size_t(2) << 20, cache_line = 64;
constexpr std::size_t task = 64;  // bricks

}  // namespace

namespace {

/// What fields gave back.
struct Kept {
    std::mutex mutex;
    int users = 0;
    std::multimap<std::size_t, float*> memory;  // by bytes

    void clear() {
        for (const auto& [bytes, p] : memory) std::free(p);
        memory.clear();
    }
};

Kept& kept() {
    static Kept all;
    return all;
}

/// The smallest piece that is large enough; null where there is none: then all are given back.
float* take_kept(std::size_t& bytes) {
    Kept& k = kept();
    const std::lock_guard<std::mutex> lock(k.mutex);
    const auto found = k.memory.lower_bound(bytes);
    if (found == k.memory.end()) {
        k.clear();
        return nullptr;
    }
    bytes = found->first;
    float* const p = found->second;
    k.memory.erase(found);
    return p;
}

}  // namespace

BlockField::Reuse::Reuse() {
    const std::lock_guard<std::mutex> lock(kept().mutex);
    ++kept().users;
}

BlockField::Reuse::~Reuse() {
    const std::lock_guard<std::mutex> lock(kept().mutex);
    if (--kept().users == 0) kept().clear();
}

void BlockField::Free::operator()(float* p) const {
    Kept& k = kept();
    const std::lock_guard<std::mutex> lock(k.mutex);
    if (k.users > 0 && bytes >= 4 * huge_page)
        k.memory.emplace(bytes, p);
    else
        std::free(p);
}

BlockField::BlockField(std::size_t bricks) : bricks_(bricks) {
    const std::size_t wanted = std::max(bricks, std::size_t(1)) * brick_size * sizeof(float);
    const std::size_t alignment = wanted >= 4 * huge_page ? huge_page : cache_line;
    std::size_t bytes = (wanted + alignment - 1) / alignment * alignment;
    float* p = alignment == huge_page ? take_kept(bytes) : nullptr;
    if (!p) {
        p = static_cast<float*>(std::aligned_alloc(alignment, bytes));
        if (!p) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
        if (alignment == huge_page) madvise(p, bytes, MADV_HUGEPAGE);  // fewer misses of the TLB; advice only
#endif
    }
    data_ = std::unique_ptr<float[], Free>(p, Free(bytes));
}

double FieldSummary::variance() const {
    if (count == 0) return 0;
    const double m = mean();
    return std::max(0.0, sum_of_squares / static_cast<double>(count) - m * m);
}

namespace {

FieldSummary nothing_yet() {
    FieldSummary s;
    s.min = std::numeric_limits<float>::infinity();
    s.max = -s.min;
    return s;
}

void join_summaries(FieldSummary& a, const FieldSummary& b) {
    a.sum += b.sum;
    a.sum_of_squares += b.sum_of_squares;
    a.min = std::min(a.min, b.min);
    a.max = std::max(a.max, b.max);
    a.count += b.count;
    a.non_finite += b.non_finite;
}

}  // namespace

FieldTotal::FieldTotal() : total_(nothing_yet(), join_summaries) {}

void FieldTotal::add(const BlockLayout& layout, const float* bricks) {
    total_.add(layout, sum_by_cell(layout, nothing_yet(), [&](std::size_t i, FieldSummary& s) {
                   const float* v = bricks + i * BlockField::brick_size;
                   for (std::size_t x = 0; x < 8; ++x)
                       for (std::uint64_t word = layout.mask(i)[x]; word; word &= word - 1) {
                           const float value = v[64 * x + static_cast<std::size_t>(__builtin_ctzll(word))];
                           if (!std::isfinite(value)) {
                               ++s.non_finite;
                               continue;
                           }
                           ++s.count;
                           s.sum += value;
                           s.sum_of_squares += static_cast<double>(value) * value;
                           s.min = std::min(s.min, value);
                           s.max = std::max(s.max, value);
                       }
               }));
}

FieldSummary FieldTotal::summary(Team* team) const {
    FieldSummary total = total_.total(team);
    if (total.count == 0) total.min = total.max = 0;
    return total;
}

FieldSummary summarize(const BlockLayout& layout, const float* bricks, Team* team) {
    FieldTotal total;
    total.add(layout, bricks);
    return total.summary(team);
}

std::uint64_t hash_of_bricks(const BlockLayout& layout, const float* bricks) {
    const auto of_cell = sum_by_cell(layout, std::uint64_t(0), [&](std::size_t brick, std::uint64_t& sum) {
        const openvdb::Coord& at = layout.origin(brick);
        const std::uint64_t place = hash_of(&at, sizeof at, 0);
        sum += hash_of(bricks + brick * BlockField::brick_size, BlockField::brick_size * sizeof(float),
                       hash_of(&layout.mask(brick), sizeof(BlockLayout::Mask), place));
    });
    std::uint64_t sum = 0;
    for (const std::uint64_t value : of_cell) sum += value;
    return sum;
}

double squared_distance(const BlockLayout& layout, const float* a, const float* b, Team* team) {
    const auto part = [&](std::size_t brick, double& sum) {
        // Inactive voxels are 0 in every field.
        for (std::size_t i = brick * BlockField::brick_size; i < (brick + 1) * BlockField::brick_size; ++i) {
            const double d = static_cast<double>(a[i]) - b[i];
            sum += d * d;
        }
    };
    CellTotal<double> total(0.0, [](double& sum, const double& more) { sum += more; });
    total.add(layout, sum_by_cell(layout, 0.0, part));
    return total.total(team);
}

void load(const BlockLayout& layout, const openvdb::FloatTree& tree, float offset, float* out) {
    parallel_blocks(layout.brick_count(), task, [&](std::size_t begin, std::size_t end) {
        openvdb::FloatTree::LeafNodeType const* node = nullptr;
        openvdb::tree::ValueAccessor<const openvdb::FloatTree> accessor(tree);
        for (std::size_t i = begin; i < end; ++i) {
            node = accessor.probeConstLeaf(layout.origin(i));
            if (!node) throw InvalidInput("the tree lacks a leaf of its layout");
            const float* in = node->buffer().data();
            float* to = out + i * BlockField::brick_size;
            if (layout.full(i)) {
                for (int k = 0; k < leaf::size; ++k) to[k] = in[k] - offset;
                continue;
            }
            for (int k = 0; k < leaf::size; ++k) {
                const bool on = layout.mask(i)[static_cast<std::size_t>(k >> 6)] >> (k & 63) & 1;
                to[k] = on ? in[k] - offset : 0.0f;
            }
        }
    });
}

void store(const BlockLayout& layout, const float* bricks, float offset, openvdb::FloatTree& tree) {
    std::vector<openvdb::FloatTree::LeafNodeType*> nodes(layout.brick_count());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        nodes[i] = tree.probeLeaf(layout.origin(i));
        if (!nodes[i]) throw InvalidInput("the tree lacks a leaf of its layout");
    }
    parallel_for(nodes.size(), 64, [&](std::size_t i) {
        const float* in = bricks + i * BlockField::brick_size;
        float* to = nodes[i]->buffer().data();
        for (std::size_t x = 0; x < 8; ++x)
            for (std::uint64_t word = layout.mask(i)[x]; word; word &= word - 1) {
                const std::size_t k = 64 * x + static_cast<std::size_t>(__builtin_ctzll(word));
                to[k] = in[k] + offset;
            }
    });
}

}  // namespace vdbgeo::stencil
