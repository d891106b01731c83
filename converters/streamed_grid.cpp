#include "converters/streamed_grid.h"

#include <openvdb/io/Compression.h>
#include <openvdb/io/io.h>

#include <algorithm>
#include <cstring>
#include <sstream>

namespace vdbgeo {
namespace {

using leaf::Leaf;
using leaf::LowerNode;
using leaf::UpperNode;
using openvdb::Coord;

constexpr int lower_bits = 7;  // a lower node has 128³ voxels, an upper one 32³ lower nodes
constexpr float unknown = StripSorter::unknown_background;

constexpr int node_of(int voxel) { return voxel >> lower_bits; }

/// Number of a leaf's place in its lower node.
std::uint16_t slot_of(const Coord& origin) {
    return static_cast<std::uint16_t>((origin.x() >> 3 & 15) << 8 | (origin.y() >> 3 & 15) << 4 |
                                      (origin.z() >> 3 & 15));
}

/// The active voxels' box, from the bits of the mask: a word for each x, eight bits in it for each y.
void expand(openvdb::CoordBBox& box, const Coord& origin, const std::uint64_t* words) {
    std::uint64_t all = 0;
    int low[3] = {8, 0, 0}, high[3] = {-1, 7, 7};
    for (int x = 0; x < 8; ++x) {
        all |= words[x];
        if (words[x] == 0) continue;
        low[0] = std::min(low[0], x);
        high[0] = x;
    }
    if (all == 0) return;
    low[1] = __builtin_ctzll(all) / 8;
    high[1] = 7 - __builtin_clzll(all) / 8;
    std::uint64_t z = all | all >> 32;
    z |= z >> 16;
    z = (z | z >> 8) & 255;
    low[2] = __builtin_ctzll(z);
    high[2] = 63 - __builtin_clzll(z);
    box.expand(openvdb::CoordBBox(origin + Coord(low[0], low[1], low[2]),
                                  origin + Coord(high[0], high[1], high[2])));
}

/// Writes the values of a leaf as LeafNode::writeBuffers does behind the mask. Where nothing but the
/// background is inactive, as everywhere without a band, there is no need to look for other inactive values.
void write_values(std::ostream& out, const Leaf& leaf, const VdbWriteOptions& options, bool only_background) {
    const auto& mask = leaf.getValueMask();
    const float* values = leaf.buffer().data();
    if (options.half || !only_background) {
        openvdb::io::writeCompressedValues(out, const_cast<float*>(values), Leaf::SIZE, mask,
                                           Leaf::NodeMaskType(), options.half);
        return;
    }
    out.put(openvdb::io::NO_MASK_OR_INACTIVE_VALS);
    float active[Leaf::SIZE];
    std::size_t count = 0;
    for (std::uint32_t n = 0; n < 8; ++n)
        for (std::uint64_t word = mask.getWord<std::uint64_t>(n); word != 0; word &= word - 1)
            active[count++] = values[64 * n + static_cast<std::uint32_t>(__builtin_ctzll(word))];
    const char* bytes = reinterpret_cast<const char*>(active);
    if (options.compression == VdbWriteOptions::Compression::blosc)
        openvdb::io::bloscToStream(out, bytes, sizeof(float), count);
    else if (options.compression == VdbWriteOptions::Compression::zip)
        openvdb::io::zipToStream(out, bytes, count * sizeof(float));
    else
        out.write(bytes, static_cast<std::streamsize>(count * sizeof(float)));
}

}  // namespace

struct PackedLeaves::Head {
    std::uint16_t slot = 0;
    std::uint16_t tile = 0;  // SortedBlock::Tile; none: a leaf
    float tile_value = 0;
    std::uint32_t bytes = 0;  // of the leaf's buffer
    std::uint32_t unused = 0;
    std::uint64_t mask[8] = {};
};

struct PackedLeaves::Row {
    struct Part {  // of one lower node
        Coord node;
        std::vector<Head> heads;
        std::size_t body_begin = 0, body_end = 0;
    };
    std::vector<Part> parts;
    std::string body;
    std::uint64_t leaves = 0, active = 0;
    openvdb::CoordBBox box;
    RoundingError half_error;
};

struct PackedLeaves::Node {
    struct Entry {
        Head head;
        std::size_t body = 0;  // where its buffer begins in `bodies`
    };
    std::vector<Entry> entries;  // by slot
    std::vector<char> bodies;
};

PackedLeaves::PackedLeaves(const StripSorter& sorter, const VdbWriteOptions& options, std::uint64_t memory,
                           const std::filesystem::path& scratch)
    : options_(options),
      order_(sorter.order()),
      only_background_(!sorter.options().band),
      store_(memory, scratch) {
    const Vec3i& size = sorter.size();
    nodes_ = Coord(node_of(size.x() - 1) + 1, node_of(size.y() - 1) + 1, node_of(size.z() - 1) + 1);
    runs_.resize(static_cast<std::size_t>(nodes_.x()) * static_cast<std::size_t>(nodes_.y()) *
                 static_cast<std::size_t>(nodes_.z()));
}

std::size_t PackedLeaves::node_index(const Coord& node) const {
    return (static_cast<std::size_t>(node.x()) * static_cast<std::size_t>(nodes_.y()) +
            static_cast<std::size_t>(node.y())) *
               static_cast<std::size_t>(nodes_.z()) +
           static_cast<std::size_t>(node.z());
}

std::shared_ptr<const PackedLeaves::Row> PackedLeaves::pack(const SortedStrip& strip) const {
    auto row = std::make_shared<Row>();
    if (strip.blocks.empty()) return row;
    std::ostringstream out(std::ios::binary);
    openvdb::io::setDataCompression(out, compression_flags(options_));
    openvdb::io::setGridClass(out, openvdb::GRID_UNKNOWN);
    openvdb::io::setGridBackgroundValuePtr(out, &unknown);
    std::size_t written = 0;
    for (const SortedBlock& block : strip.blocks) {
        const Coord node = block.origin >> lower_bits;
        if (row->parts.empty() || row->parts.back().node != node) {
            row->parts.emplace_back();
            row->parts.back().node = node;
            row->parts.back().body_begin = written;
        }
        Head head;
        head.slot = slot_of(block.origin);
        head.tile = static_cast<std::uint16_t>(block.tile);
        head.tile_value = block.tile_value;
        if (block.leaf) {
            const auto& mask = block.leaf->getValueMask();
            for (openvdb::Index n = 0; n < 8; ++n) head.mask[n] = mask.getWord<std::uint64_t>(n);
            write_values(out, *block.leaf, options_, only_background_);
            const std::size_t end = static_cast<std::size_t>(out.tellp());
            head.bytes = static_cast<std::uint32_t>(end - written);
            written = end;
            ++row->leaves;
            if (options_.half) row->half_error.join(half_rounding_error(*block.leaf));
            row->active += mask.countOn();
            expand(row->box, block.origin, head.mask);
        } else if (block.tile == SortedBlock::Tile::kept) {
            row->active += leaf::size;
            if (options_.half) row->half_error.join(half_rounding_error(block.tile_value, block.origin));
            row->box.expand(openvdb::CoordBBox::createCube(block.origin, leaf::dim));
        }
        row->parts.back().heads.push_back(head);
        row->parts.back().body_end = written;
    }
    row->body = out.str();
    return row;
}

void PackedLeaves::add_slab(const std::vector<std::shared_ptr<const Row>>& rows) {
    // Rows of leaves come along one axis of the nodes: sixteen of them, and the next node begins.
    for (std::size_t begin = 0; begin < rows.size(); begin += 16) {
        const std::size_t end = std::min(begin + 16, rows.size());
        std::vector<std::pair<std::size_t, const Row::Part*>> parts;  // by node, then by row
        std::vector<const Row*> row_of;
        for (std::size_t r = begin; r < end; ++r)
            for (const Row::Part& part : rows[r]->parts) parts.emplace_back(r, &part);
        std::stable_sort(parts.begin(), parts.end(),
                         [](const auto& a, const auto& b) { return a.second->node < b.second->node; });
        for (std::size_t i = 0; i < parts.size();) {
            std::size_t last = i;
            Run run;
            run.at = store_.size();
            for (; last < parts.size() && parts[last].second->node == parts[i].second->node; ++last) {
                const auto& heads = parts[last].second->heads;
                store_.append(heads.data(), heads.size() * sizeof(Head));
                run.heads += static_cast<std::uint32_t>(heads.size());
            }
            for (std::size_t p = i; p < last; ++p) {
                const Row::Part& part = *parts[p].second;
                store_.append(rows[parts[p].first]->body.data() + part.body_begin,
                              part.body_end - part.body_begin);
                run.body_bytes += part.body_end - part.body_begin;
            }
            runs_[node_index(parts[i].second->node)].push_back(run);
            i = last;
        }
    }
    for (const auto& row : rows) {
        leaves_ += row->leaves;
        active_ += row->active;
        if (!row->box.empty()) box_.expand(row->box);
        half_error_.join(row->half_error);
    }
}

PackedLeaves::Node PackedLeaves::pick_up(std::size_t node, bool bodies) const {
    Node result;
    std::size_t total = 0;
    for (const Run& run : runs_[node]) total += run.body_bytes;
    if (bodies) result.bodies.resize(total);
    std::vector<Head> heads;
    std::size_t body = 0;
    for (const Run& run : runs_[node]) {
        heads.resize(run.heads);
        store_.read(run.at, heads.data(), run.heads * sizeof(Head));
        if (bodies)
            store_.read(run.at + run.heads * sizeof(Head), result.bodies.data() + body, run.body_bytes);
        for (const Head& head : heads) {
            result.entries.push_back({head, body});
            body += head.bytes;
        }
    }
    std::sort(result.entries.begin(), result.entries.end(),
              [](const Node::Entry& a, const Node::Entry& b) { return a.head.slot < b.head.slot; });
    return result;
}

/// The children of the root that hold anything, in the order of their positions.
template <class Visit>
void PackedLeaves::for_each_root_child(const Visit& visit) const {
    const int step = 32;
    for (int x = 0; x < nodes_.x(); x += step)
        for (int y = 0; y < nodes_.y(); y += step)
            for (int z = 0; z < nodes_.z(); z += step) {
                bool any = false;
                for_each_node(Coord(x, y, z), [&](const Coord&, std::size_t) { any = true; });
                if (any) visit(Coord(x, y, z));
            }
}

/// Lower nodes under one of them that hold anything, in the order of the tree.
template <class Visit>
void PackedLeaves::for_each_node(const Coord& first, const Visit& visit) const {
    const int step = 32;
    for (int x = first.x(); x < std::min(first.x() + step, nodes_.x()); ++x)
        for (int y = first.y(); y < std::min(first.y() + step, nodes_.y()); ++y)
            for (int z = first.z(); z < std::min(first.z() + step, nodes_.z()); ++z) {
                const std::size_t n = node_index(Coord(x, y, z));
                if (!runs_[n].empty()) visit(Coord(x, y, z) - first, n);
            }
}

void PackedLeaves::write_lower_node(std::ostream& os, std::size_t index, float background) const {
    const Node node = pick_up(index, false);
    LowerNode::NodeMaskType children, active;
    std::vector<float> values(LowerNode::NUM_VALUES, background);
    for (const Node::Entry& entry : node.entries) {
        const Head& head = entry.head;
        const auto tile = static_cast<SortedBlock::Tile>(head.tile);
        if (tile == SortedBlock::Tile::none) children.setOn(head.slot);
        if (tile == SortedBlock::Tile::kept) active.setOn(head.slot);
        values[head.slot] = tile == SortedBlock::Tile::none ? 0 : head.tile_value;
    }
    children.save(os);
    active.save(os);
    openvdb::io::writeCompressedValues(os, values.data(), LowerNode::NUM_VALUES, active, children,
                                       options_.half);
    for (const Node::Entry& entry : node.entries)
        if (static_cast<SortedBlock::Tile>(entry.head.tile) == SortedBlock::Tile::none)
            os.write(reinterpret_cast<const char*>(entry.head.mask), sizeof entry.head.mask);
}

void PackedLeaves::write_upper_node(std::ostream& os, const Coord& first, float background) const {
    UpperNode::NodeMaskType children, active;
    std::vector<float> values(UpperNode::NUM_VALUES, background);
    for_each_node(first, [&](const Coord& place, std::size_t) {
        const auto slot = static_cast<openvdb::Index>(place.x() << 10 | place.y() << 5 | place.z());
        children.setOn(slot);
        values[slot] = 0;
    });
    children.save(os);
    active.save(os);
    openvdb::io::writeCompressedValues(os, values.data(), UpperNode::NUM_VALUES, active, children,
                                       options_.half);
    for_each_node(first, [&](const Coord&, std::size_t node) { write_lower_node(os, node, background); });
}

void PackedLeaves::write_topology(std::ostream& os, float background) const {
    const auto put = [&](const auto& value) {
        os.write(reinterpret_cast<const char*>(&value), sizeof value);
    };
    put(std::int32_t(1));  // buffers a leaf
    put(options_.half ? openvdb::io::truncateRealToHalf(background) : background);
    openvdb::io::setGridBackgroundValuePtr(os, &background);
    std::uint32_t children = 0;
    for_each_root_child([&](const Coord&) { ++children; });
    put(std::uint32_t(0));  // tiles
    put(children);
    for_each_root_child([&](const Coord& first) {
        const Coord origin = first << lower_bits;
        os.write(reinterpret_cast<const char*>(origin.asPointer()), 3 * sizeof(std::int32_t));
        write_upper_node(os, first, background);
    });
    openvdb::io::setGridBackgroundValuePtr(os, nullptr);  // it pointed to a value that goes away now
}

void PackedLeaves::write_buffers(std::ostream& os, const Progress& progress) const {
    std::uint64_t written = 0;
    for_each_root_child([&](const Coord& first) {
        for_each_node(first, [&](const Coord&, std::size_t index) {
            const Node node = pick_up(index, true);
            for (const Node::Entry& entry : node.entries) {
                if (static_cast<SortedBlock::Tile>(entry.head.tile) != SortedBlock::Tile::none) continue;
                os.write(reinterpret_cast<const char*>(entry.head.mask), sizeof entry.head.mask);
                os.write(node.bodies.data() + entry.body, entry.head.bytes);
                ++written;
            }
            progress.report(static_cast<double>(written) /
                            static_cast<double>(std::max<std::uint64_t>(leaves_, 1)));
        });
    });
}

std::uint64_t PackedLeaves::bytes_as_tree() const {
    std::uint64_t upper = 0, lower = 0;
    for_each_root_child([&](const Coord& first) {
        ++upper;
        for_each_node(first, [&](const Coord&, std::size_t) { ++lower; });
    });
    const auto of_node = [](auto node) {
        using Of = decltype(node);
        return Of::NUM_VALUES * sizeof(typename Of::UnionType) + node.getChildMask().memUsage() +
               node.getValueMask().memUsage() + sizeof(Coord);
    };
    return sizeof(openvdb::FloatTree) + sizeof(openvdb::FloatTree::RootNodeType) +
           upper * of_node(UpperNode()) + lower * of_node(LowerNode()) +
           leaves_ * Leaf(Coord(), 0.f).memUsage();
}

StreamedGrid::StreamedGrid(std::shared_ptr<const PackedLeaves> leaves, float background)
    : SelfWritingGrid(background), leaves_(std::move(leaves)) {
    setName("density");
    setGridClass(openvdb::GRID_UNKNOWN);
    if (leaves_->half()) setSaveFloatAsHalf(true);
}

}  // namespace vdbgeo
