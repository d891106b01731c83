#include "vdbgeo/stencil/block_field.h"

#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <mutex>
#include <new>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/file_hash.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/brick_sums.h"
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

void FieldTotal::add_brick(const BlockLayout::Mask& mask, const float* values) {
    // Side by side, in a fixed order. What is not finite shows in the squares.
    constexpr std::size_t wide = 16;
    double sums[wide] = {}, squares[wide] = {};
    float low[wide], high[wide];
    std::fill_n(low, wide, min_);
    std::fill_n(high, wide, max_);
    const bool full = std::all_of(mask.begin(), mask.end(), [](std::uint64_t word) { return ~word == 0; });
    if (full) {
        for (std::size_t i = 0; i < BlockField::brick_size; i += wide)
            for (std::size_t k = 0; k < wide; ++k) {
                const float value = values[i + k];
                sums[k] += value;
                squares[k] += static_cast<double>(value) * value;
                low[k] = value < low[k] ? value : low[k];
                high[k] = value > high[k] ? value : high[k];
            }
    }
    double sum = 0, square = 0;
    for (std::size_t k = 0; k < wide; ++k) {
        sum += sums[k];
        square += squares[k];
    }
    if (!full || !std::isfinite(square)) return add_sparse_brick(mask, values);
    count_ += BlockField::brick_size;
    min_ = *std::min_element(low, low + wide);
    max_ = *std::max_element(high, high + wide);
    sum_.add(sum);
    squares_.add(square);
}

void FieldTotal::add_sparse_brick(const BlockLayout::Mask& mask, const float* values) {
    double sum = 0, squares = 0;
    for (std::size_t x = 0; x < 8; ++x)
        for (std::uint64_t word = mask[x]; word; word &= word - 1) {
            const float value = values[64 * x + static_cast<std::size_t>(__builtin_ctzll(word))];
            if (!std::isfinite(value)) {
                ++non_finite_;
                continue;
            }
            ++count_;
            sum += value;
            squares += static_cast<double>(value) * value;
            min_ = std::min(min_, value);
            max_ = std::max(max_, value);
        }
    sum_.add(sum);
    squares_.add(squares);
}

void FieldTotal::add(const BlockLayout& layout, const float* bricks) {
    add(sum_of_bricks<FieldTotal>(layout, [&](std::size_t i, FieldTotal& total) {
        total.add_brick(layout.mask(i), bricks + i * BlockField::brick_size);
    }));
}

void FieldTotal::add(const FieldTotal& other) {
    sum_.add(other.sum_);
    squares_.add(other.squares_);
    min_ = std::min(min_, other.min_);
    max_ = std::max(max_, other.max_);
    count_ += other.count_;
    non_finite_ += other.non_finite_;
}

FieldSummary FieldTotal::summary(Team* team) const {
    FieldTotal all = *this;
    if (team) {
        all.sum_.add_up(*team);
        all.squares_.add_up(*team);
        for (const float value : gather_all<float>(*team, {min_})) all.min_ = std::min(all.min_, value);
        for (const float value : gather_all<float>(*team, {max_})) all.max_ = std::max(all.max_, value);
        std::vector<std::uint64_t> counts{count_, non_finite_};
        team->add_up(counts);
        all.count_ = counts[0];
        all.non_finite_ = counts[1];
    }
    FieldSummary s{all.sum_.value(), all.squares_.value(), all.min_, all.max_, all.count_, all.non_finite_};
    if (s.count == 0) s.min = s.max = 0;
    return s;
}

FieldSummary summarize(const BlockLayout& layout, const float* bricks, Team* team) {
    FieldTotal total;
    total.add(layout, bricks);
    return total.summary(team);
}

std::uint64_t hash_of_bricks(const BlockLayout& layout, const float* bricks) {
    struct Sum {
        std::uint64_t value = 0;
        void add(const Sum& other) { value += other.value; }
    };
    return sum_of_bricks<Sum>(layout,
                              [&](std::size_t brick, Sum& sum) {
                                  const openvdb::Coord& at = layout.origin(brick);
                                  const std::uint64_t place = hash_of(&at, sizeof at, 0);
                                  sum.value +=
                                      hash_of(bricks + brick * BlockField::brick_size,
                                              BlockField::brick_size * sizeof(float),
                                              hash_of(&layout.mask(brick), sizeof(BlockLayout::Mask), place));
                              })
        .value;
}

double squared_distance(const BlockLayout& layout, const float* a, const float* b, Team* team) {
    ExactSum total = sum_of_bricks<ExactSum>(layout, [&](std::size_t brick, ExactSum& sum) {
        double of_brick = 0;
        // Inactive voxels are 0 in every field.
        for (std::size_t i = brick * BlockField::brick_size; i < (brick + 1) * BlockField::brick_size; ++i) {
            const double d = static_cast<double>(a[i]) - b[i];
            of_brick += d * d;
        }
        sum.add(of_brick);
    });
    if (team) total.add_up(*team);
    return total.value();
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
