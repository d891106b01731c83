#include "vdbgeo/volume/components.h"

#include <fmt/format.h>
#include <openvdb/tools/Prune.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <map>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/mask_block.h"

namespace vdbgeo {
namespace {

using mask::Block;
using mask::dim;
using mask::Place;
using mask::Row;
using openvdb::Coord;

/// Sets of numbers, each named by its smallest member.
template <class Number>
Number find_root(std::vector<Number>& parent, Number i) {
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

template <class Number>
void unite(std::vector<Number>& parent, Number a, Number b) {
    a = find_root(parent, a);
    b = find_root(parent, b);
    parent[std::max(a, b)] = std::min(a, b);
}

/// Neighbouring voxels along z in one row.
struct Run {
    std::uint8_t begin, last;
};

/// Voxels of one component along a line on a face of a block.
struct FaceRun {
    std::uint8_t line, begin, last;
    std::uint32_t label;  // of those components of the block that touch its border
};
using Face = std::vector<FaceRun>;

/// What the rest of the mask has to know of a block: the components that touch its border.
struct Border {
    std::vector<std::uint32_t> sizes;  // by label
    std::array<Face, 6> faces;         // low x, high x, low y, high y, low z, high z; by line, then begin
};

/// Those of all blocks; a full tile has one component and always the same faces.
class Borders {
 public:
    explicit Borders(const std::vector<Place>& places) : places_(places), borders_(places.size()) {
        Face face;
        for (int line = 0; line < dim; ++line)
            face.push_back({static_cast<std::uint8_t>(line), 0, dim - 1, 0});
        full_ = {{dim * dim * dim}, {face, face, face, face, face, face}};
    }
    void set(std::size_t block, Border border) { borders_[block] = std::move(border); }
    const Border& operator[](std::size_t block) const {
        return places_[block].node ? borders_[block] : full_;
    }

 private:
    const std::vector<Place>& places_;
    std::vector<Border> borders_;
    Border full_;
};

/// The components of one block. Kept from block to block for its memory.
class Components {
 public:
    void find(const Block& block);

    /// Component (its smallest run) of each run, and the voxels of each component at its number.
    std::size_t runs() const { return runs_.size(); }
    bool is_component(std::size_t i) const { return parent_[i] == i; }
    std::uint32_t size_of(std::size_t run) const { return size_[parent_[run]]; }
    bool at_border(std::size_t run) const { return label_[parent_[run]] != 0; }
    /// Of a component at the border.
    std::uint32_t label_of(std::size_t run) const { return label_[parent_[run]] - 1; }

    Border border() const;

    /// Switches off, in the block, the runs for which drop(run) holds; how many voxels went.
    template <class Drop>
    std::uint64_t remove(Block& block, const Drop& drop) const;

 private:
    void add_runs(const Row& row);
    void join(std::size_t row, std::size_t other);
    void number_border();
    Face side(bool across_x, int at) const;
    Face end(bool high) const;

    std::vector<Run> runs_;
    std::vector<std::uint32_t> parent_, size_, label_;  // label_: 0 inside the block, else the label + 1
    std::vector<std::uint32_t> first_;                  // run of each row x · dim + y
};

/// Positions of the set bits, lowest first.
template <class Take>
void for_each_bit(const std::array<std::uint64_t, 2>& words, const Take& take) {
    for (std::size_t w = 0; w < 2; ++w)
        for (std::uint64_t bits = words[w]; bits; bits &= bits - 1)
            take(static_cast<std::uint8_t>(64 * w) + static_cast<std::uint8_t>(__builtin_ctzll(bits)));
}

void Components::add_runs(const Row& row) {
    const auto [low, high] = row.words;
    const std::size_t old = runs_.size();
    std::size_t ended = old;
    for_each_bit({low & ~(low << 1), high & ~(high << 1 | low >> 63)}, [&](int z) {
        runs_.push_back({static_cast<std::uint8_t>(z), 0});
    });
    for_each_bit({low & ~(low >> 1 | high << 63), high & ~(high >> 1)},
                 [&](int z) { runs_[ended++].last = static_cast<std::uint8_t>(z); });
    for (std::size_t i = old; i < runs_.size(); ++i) parent_.push_back(static_cast<std::uint32_t>(i));
}

/// Unites the runs of a row with those that they touch in a row beside it.
void Components::join(std::size_t row, std::size_t other) {
    std::uint32_t i = first_[row], j = first_[other];
    while (i < first_[row + 1] && j < first_[other + 1]) {
        if (runs_[i].begin <= runs_[j].last && runs_[j].begin <= runs_[i].last) unite(parent_, i, j);
        runs_[i].last < runs_[j].last ? ++i : ++j;
    }
}

void Components::find(const Block& block) {
    runs_.clear();
    parent_.clear();
    first_.assign(dim * dim + 1, 0);
    for (int x = 0; x < dim; ++x)
        for (int y = 0; y < dim; ++y) {
            const auto number = static_cast<std::size_t>(x * dim + y);
            const Row& row = block.row(x, y);
            if (!row.empty()) add_runs(row);
            first_[number + 1] = static_cast<std::uint32_t>(runs_.size());
            if (x > 0 && row.meets(block.row(x - 1, y))) join(number, number - dim);
            if (y > 0 && row.meets(block.row(x, y - 1))) join(number, number - 1);
        }
    // A root is smaller than its members: one sweep flattens.
    size_.assign(runs_.size(), 0);
    for (std::size_t i = 0; i < runs_.size(); ++i) {
        parent_[i] = parent_[parent_[i]];
        size_[parent_[i]] += static_cast<std::uint32_t>(runs_[i].last - runs_[i].begin + 1);
    }
    number_border();
}

/// Numbers the components at the border by their first run. What is inside does not count, so the numbers
/// stay the same once components inside are removed.
void Components::number_border() {
    label_.assign(runs_.size(), 0);
    for (int x = 0; x < dim; ++x)
        for (int y = 0; y < dim; ++y) {
            const bool outer = x == 0 || x == dim - 1 || y == 0 || y == dim - 1;
            const auto number = static_cast<std::size_t>(x * dim + y);
            for (std::uint32_t i = first_[number]; i < first_[number + 1]; ++i)
                if (outer || runs_[i].begin == 0 || runs_[i].last == dim - 1) label_[parent_[i]] = 1;
        }
    std::uint32_t count = 0;
    for (std::uint32_t& label : label_)
        if (label) label = ++count;
}

/// A face across x or y: its lines are rows.
Face Components::side(bool across_x, int at) const {
    Face face;
    for (int line = 0; line < dim; ++line) {
        const auto number = static_cast<std::size_t>(across_x ? at * dim + line : line * dim + at);
        for (std::uint32_t i = first_[number]; i < first_[number + 1]; ++i)
            face.push_back({static_cast<std::uint8_t>(line), runs_[i].begin, runs_[i].last, label_of(i)});
    }
    return face;
}

/// A face across z: its lines run along y.
Face Components::end(bool high) const {
    Face face;
    for (int x = 0; x < dim; ++x)
        for (int y = 0; y < dim; ++y) {
            const auto number = static_cast<std::size_t>(x * dim + y);
            if (first_[number] == first_[number + 1]) continue;
            const std::uint32_t i = high ? first_[number + 1] - 1 : first_[number];
            if (high ? runs_[i].last != dim - 1 : runs_[i].begin != 0) continue;
            if (!face.empty() && face.back().line == x && face.back().last + 1 == y)
                face.back().last = static_cast<std::uint8_t>(y);
            else
                face.push_back({static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y),
                                static_cast<std::uint8_t>(y), label_of(i)});
        }
    return face;
}

Border Components::border() const {
    Border border;
    for (std::size_t i = 0; i < runs(); ++i)
        if (is_component(i) && at_border(i)) border.sizes.push_back(size_of(i));
    border.faces = {side(true, 0),        side(true, dim - 1), side(false, 0),
                    side(false, dim - 1), end(false),          end(true)};
    for (Face& face : border.faces) face.shrink_to_fit();
    return border;
}

template <class Drop>
std::uint64_t Components::remove(Block& block, const Drop& drop) const {
    std::uint64_t gone = 0;
    for (int x = 0; x < dim; ++x)
        for (int y = 0; y < dim; ++y) {
            const auto number = static_cast<std::size_t>(x * dim + y);
            for (std::uint32_t i = first_[number]; i < first_[number + 1]; ++i) {
                if (!drop(i)) continue;
                const Row bits = mask::row_between(runs_[i].begin, runs_[i].last);
                Row& row = block.row(x, y);
                row.words[0] &= ~bits.words[0];
                row.words[1] &= ~bits.words[1];
                gone += static_cast<std::uint64_t>(runs_[i].last - runs_[i].begin + 1);
            }
        }
    return gone;
}

struct Workspace {
    Block block;
    Components components;

    void find(const mask::LowerNode& node) {
        block.load(node);
        components.find(block);
    }
};
using Workspaces = tbb::enumerable_thread_specific<Workspace>;

/// Unites the components that touch across two faces which lie on each other.
void join_faces(const Face& a, const Face& b, std::uint64_t first_a, std::uint64_t first_b,
                std::vector<std::uint64_t>& parent) {
    auto i = a.begin(), j = b.begin();
    while (i != a.end() && j != b.end()) {
        if (i->line == j->line && i->begin <= j->last && j->begin <= i->last)
            unite(parent, first_a + i->label, first_b + j->label);
        std::pair(i->line, i->last) < std::pair(j->line, j->last) ? ++i : ++j;
    }
}

/// The components that touch the borders of blocks, each with its whole size.
struct Joined {
    std::vector<std::uint64_t> first;   // of each block: the number of its label 0
    std::vector<std::uint64_t> parent;  // of each label: its component, flat
    std::vector<std::uint64_t> size;    // at each component
};

Joined join_blocks(const std::vector<Place>& places, const Borders& borders) {
    Joined all;
    std::map<Coord, std::size_t> index;
    for (std::size_t b = 0; b < places.size(); ++b) {
        index[places[b].origin] = b;
        all.first.push_back(all.size.size());
        all.size.insert(all.size.end(), borders[b].sizes.begin(), borders[b].sizes.end());
    }
    for (std::uint64_t i = 0; i < all.size.size(); ++i) all.parent.push_back(i);
    for (std::size_t b = 0; b < places.size(); ++b)
        for (std::size_t axis = 0; axis < 3; ++axis) {
            Coord beside = places[b].origin;
            beside[axis] += dim;
            const auto found = index.find(beside);
            if (found == index.end()) continue;
            join_faces(borders[b].faces[2 * axis + 1], borders[found->second].faces[2 * axis], all.first[b],
                       all.first[found->second], all.parent);
        }
    for (std::uint64_t i = 0; i < all.parent.size(); ++i) {
        const std::uint64_t root = all.parent[i] = all.parent[all.parent[i]];
        if (root != i) all.size[root] += all.size[i];
    }
    return all;
}

/// Tells how many of the blocks are done, from any thread.
class BlockProgress {
 public:
    BlockProgress(const Progress& progress, std::size_t blocks)
        : progress_(progress), blocks_(static_cast<double>(blocks)) {}
    void one_more() { progress_.report(static_cast<double>(++done_) / blocks_); }

 private:
    Progress progress_;
    double blocks_;
    std::atomic<std::size_t> done_{0};
};

void put_back(openvdb::MaskTree& tree, const Coord& origin, const Block& block) {
    block.store(*tree.probeNode<mask::LowerNode>(origin));
}

}  // namespace

std::uint64_t remove_small_components(openvdb::MaskTree& mask, std::uint64_t min_voxels,
                                      const Progress& progress) {
    if (min_voxels < 2) return 0;
    const std::vector<Place> places = mask::places_of(mask);
    Borders borders(places);
    std::vector<std::uint64_t> gone(places.size());
    Workspaces workspaces;
    BlockProgress first_half(progress.part(0, 0.6), places.size());
    parallel_for(places.size(), 1, [&](std::size_t b) {
        first_half.one_more();
        if (!places[b].node) return;
        Workspace& w = workspaces.local();
        w.find(*places[b].node);
        borders.set(b, w.components.border());
        gone[b] = w.components.remove(w.block, [&](std::size_t run) {
            return !w.components.at_border(run) && w.components.size_of(run) < min_voxels;
        });
        if (gone[b]) put_back(mask, places[b].origin, w.block);
    });

    const Joined all = join_blocks(places, borders);
    const auto small = [&](std::uint64_t label) { return all.size[all.parent[label]] < min_voxels; };
    BlockProgress second_half(progress.part(0.6, 1), places.size());
    parallel_for(places.size(), 1, [&](std::size_t b) {
        second_half.one_more();
        std::uint64_t goes = 0;
        for (std::uint64_t label = 0; label < borders[b].sizes.size(); ++label)
            if (small(all.first[b] + label)) goes += borders[b].sizes[label];
        gone[b] += goes;
        if (!goes || !places[b].node) return;
        Workspace& w = workspaces.local();
        w.find(*places[b].node);
        w.components.remove(w.block, [&](std::size_t run) {
            return w.components.at_border(run) && small(all.first[b] + w.components.label_of(run));
        });
        put_back(mask, places[b].origin, w.block);
    });
    std::uint64_t total = 0;
    for (std::size_t b = 0; b < places.size(); ++b) {
        if (gone[b] && !places[b].node)
            mask.addTile(mask::LowerNode::LEVEL + 1, places[b].origin, false, false);
        total += gone[b];
    }
    mask.clearAllAccessors();
    openvdb::tools::pruneInactive(mask);
    return total;
}

std::vector<std::uint64_t> component_sizes(const openvdb::MaskTree& mask) {
    const std::vector<Place> places = mask::places_of(mask);
    Borders borders(places);
    std::vector<std::vector<std::uint32_t>> inside(places.size());
    Workspaces workspaces;
    parallel_for(places.size(), 1, [&](std::size_t b) {
        if (!places[b].node) return;
        Workspace& w = workspaces.local();
        w.find(*places[b].node);
        borders.set(b, w.components.border());
        for (std::size_t i = 0; i < w.components.runs(); ++i)
            if (w.components.is_component(i) && !w.components.at_border(i))
                inside[b].push_back(w.components.size_of(i));
    });
    const Joined all = join_blocks(places, borders);
    std::vector<std::uint64_t> sizes;
    for (std::uint64_t i = 0; i < all.parent.size(); ++i)
        if (all.parent[i] == i) sizes.push_back(all.size[i]);
    for (const auto& some : inside) sizes.insert(sizes.end(), some.begin(), some.end());
    std::sort(sizes.rbegin(), sizes.rend());
    return sizes;
}

}  // namespace vdbgeo
