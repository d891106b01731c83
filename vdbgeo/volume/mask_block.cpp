#include "vdbgeo/volume/mask_block.h"

#include <algorithm>
#include <map>
#include <memory>

namespace vdbgeo::mask {
namespace {

using openvdb::Coord;
using openvdb::Index;

/// Number of a leaf in its lower node.
Index number_of(int x, int y, int z) { return static_cast<Index>((x * leaves + y) * leaves + z); }

/// Bytes of a leaf's word x ↔ byte z of the rows (x, y … y + 7).
std::uint64_t gather(const Row* row, int byte) {
    const auto word = static_cast<std::size_t>(byte / 8);
    const int shift = 8 * (byte % 8);
    std::uint64_t bits = 0;
    for (int y = 0; y < leaf_dim; ++y) bits |= (row[y].words[word] >> shift & 0xff) << 8 * y;
    return bits;
}

void scatter(std::uint64_t bits, Row* row, int byte) {
    const auto word = static_cast<std::size_t>(byte / 8);
    const int shift = 8 * (byte % 8);
    for (int y = 0; y < leaf_dim; ++y) row[y].words[word] |= (bits >> 8 * y & 0xff) << shift;
}

}  // namespace

Row row_between(int begin, int last) {
    const auto below = [](int n) { return n >= 64 ? ~std::uint64_t(0) : (std::uint64_t(1) << n) - 1; };
    const auto word = [&](int from) {
        const int first = std::max(begin - from, 0), end = std::max(last + 1 - from, first);
        return first >= 64 ? 0 : below(end) & ~below(first);
    };
    return {{word(0), word(64)}};
}

void Block::fill(bool on) {
    const std::uint64_t word = on ? ~std::uint64_t(0) : 0;
    std::fill(rows_.begin(), rows_.end(), Row{{word, word}});
}

void Block::load(const LowerNode& node) {
    fill(false);
    for (int x = 0; x < leaves; ++x)
        for (int y = 0; y < leaves; ++y)
            for (int z = 0; z < leaves; ++z) {
                const Index n = number_of(x, y, z);
                const bool child = node.getChildMask().isOn(n);
                if (!child && !node.getValueMask().isOn(n)) continue;
                for (int i = 0; i < leaf_dim; ++i) {
                    const std::uint64_t bits =
                        child ? node.getTable()[n].getChild()->getValueMask().getWord<std::uint64_t>(
                                    static_cast<Index>(i))
                              : ~std::uint64_t(0);
                    if (bits) scatter(bits, &row(x * leaf_dim + i, y * leaf_dim), z);
                }
            }
}

void Block::store(LowerNode& node) const {
    for (int x = 0; x < leaves; ++x)
        for (int y = 0; y < leaves; ++y)
            for (int z = 0; z < leaves; ++z) {
                const Index n = number_of(x, y, z);
                std::array<std::uint64_t, leaf_dim> words;
                std::uint64_t any = 0, all = ~std::uint64_t(0);
                for (int i = 0; i < leaf_dim; ++i) {
                    const std::uint64_t bits = gather(&row(x * leaf_dim + i, y * leaf_dim), z);
                    words[static_cast<std::size_t>(i)] = bits;
                    any |= bits;
                    all &= bits;
                }
                const bool child = node.getChildMask().isOn(n);
                if (any == 0 || all == ~std::uint64_t(0)) {
                    const bool on = any != 0;
                    if (child || node.getValueMask().isOn(n) != on) node.addTile(n, on, on);
                    continue;
                }
                const Coord origin = node.origin() + times(Coord(x, y, z), leaf_dim);
                Leaf* leaf = child ? node.probeLeaf(origin) : new Leaf(origin, false);
                auto& mask = leaf->getValueMask();
                for (int i = 0; i < leaf_dim; ++i)
                    mask.getWord<std::uint64_t>(static_cast<Index>(i)) = words[static_cast<std::size_t>(i)];
                if (!child) node.addLeaf(leaf);
            }
}

std::vector<Place> places_of(const openvdb::MaskTree& mask) {
    std::vector<Place> places;
    for (auto entry = mask.root().cbeginChildAll(); entry; ++entry) {
        bool value = false;
        const UpperNode* upper = entry.probeChild(value);
        const Coord origin = entry.getCoord();
        if (!upper && !entry.isValueOn()) continue;
        for (Index n = 0; n < UpperNode::NUM_VALUES; ++n) {
            Coord place;
            UpperNode::offsetToLocalCoord(n, place);
            place = origin + times(place, dim);
            if (!upper || upper->getValueMask().isOn(n)) {
                places.push_back({place, nullptr});
            } else if (upper->getChildMask().isOn(n)) {
                places.push_back({place, upper->getTable()[n].getChild()});
            }
        }
    }
    return places;
}

void fill_tree(openvdb::MaskTree& mask, std::vector<std::unique_ptr<LowerNode>>& nodes) {
    std::map<Coord, std::unique_ptr<UpperNode>> uppers;
    for (auto& node : nodes) {
        const bool full = node->getValueMask().isOn();
        if (!full && node->getValueMask().isOff() && node->getChildMask().isOff()) {
            node.reset();
            continue;
        }
        const Coord origin = node->origin() & ~(static_cast<int>(UpperNode::DIM) - 1);
        auto& upper = uppers[origin];
        if (!upper) upper = std::make_unique<UpperNode>(origin, false);
        if (full) {
            upper->addTile(UpperNode::coordToOffset(node->origin()), true, true);
            node.reset();
        } else {
            upper->addChild(node.release());
        }
    }
    for (auto& [origin, upper] : uppers) mask.root().addChild(upper.release());
}

}  // namespace vdbgeo::mask
