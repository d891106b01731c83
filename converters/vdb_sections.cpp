#include "converters/vdb_sections.h"

#include <fmt/format.h>
#include <openvdb/io/Compression.h>

#include <algorithm>
#include <map>
#include <string_view>
#include <vector>

#include "converters/mrc_sink.h"
#include "converters/vdb_byte_stream.h"
#include "converters/vdb_checks.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {

namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;
using UpperNode = FloatTree::RootNodeType::ChildNodeType;
using LowerNode = UpperNode::ChildNodeType;

template <class Mask>
Mask mask_from(std::string_view bytes) {
    Mask mask;
    static_assert(sizeof(typename Mask::Word) == 8);
    for (openvdb::Index w = 0; w < Mask::WORD_COUNT; ++w)
        std::memcpy(&mask.template getWord<typename Mask::Word>(w), bytes.data() + 8 * w, 8);
    return mask;
}

/// The children of a node of 128³ voxels: which leaves there are, and where the buffers of each begin.
struct LeafRun {
    LowerNode::NodeMaskType children;
    std::uint64_t first = 0;       ///< number of its first leaf
    std::uint64_t buffers_at = 0;  ///< where the first one's buffer begins
};

/// Takes down the leaves of a tree, and makes its tiles.
class Notes : public VdbTreeVisitor {
 public:
    Notes(const VdbSkeleton& skeleton, const VdbEntry& entry, const VdbCursor& cursor, FloatTree& tiles)
        : skeleton_(skeleton), entry_(entry), cursor_(cursor), tiles_(tiles) {}

    std::vector<LeafRun> runs;
    std::map<Coord, std::uint32_t> run_at;
    /// Where each leaf's buffer ends, counted from where its run's first one begins.
    std::vector<std::uint32_t> ends;
    std::uint64_t active = 0;
    CoordBBox box;

    void background(const char* value) override {
        std::memcpy(&background_, value, sizeof background_);
        tiles_.root().setBackground(background_, false);
    }

    void root_tile(const Coord& origin, const char* value, bool on) override {
        float number;
        std::memcpy(&number, value, sizeof number);
        tiles_.addTile(3, origin, number, on);
    }

    void node(int level, const Coord& origin, std::string_view children, std::string_view on,
              std::uint64_t values_at, std::uint64_t end) override {
        const std::string_view values = cursor_.from(values_at).substr(0, end - values_at);
        if (level == 2) return add_tiles<UpperNode>(level, origin, children, on, values);
        add_tiles<LowerNode>(level, origin, children, on, values);
        const auto mask = mask_from<LowerNode::NodeMaskType>(children);
        if (mask.isOff()) return;
        run_at.emplace(origin, static_cast<std::uint32_t>(runs.size()));
        runs.push_back({mask, noted_, 0});
        origins_.push_back(origin);
        noted_ += mask.countOn();
    }

    void leaf(std::string_view bytes, std::uint64_t at, std::uint64_t end) override {
        if (ends.empty()) ends.reserve(noted_);
        while (run_ + 1 < runs.size() && ends.size() == runs[run_ + 1].first) ++run_, slot_ = 0;
        LeafRun& run = runs[run_];
        if (ends.size() == run.first) {
            run.buffers_at = at;
            slot_ = run.children.findFirstOn();
        } else {
            slot_ = run.children.findNextOn(slot_ + 1);
        }
        ends.push_back(static_cast<std::uint32_t>(end - run.buffers_at));
        const auto mask = mask_from<Leaf::NodeMaskType>(bytes);
        const openvdb::Index count = mask.countOn();
        if (count == 0) return;
        active += count;
        Coord local;
        LowerNode::offsetToLocalCoord(slot_, local);
        expand(origins_[run_].offsetBy(8 * local.x(), 8 * local.y(), 8 * local.z()), mask);
    }

    float background() const { return background_; }

 private:
    template <class Node>
    void add_tiles(int level, const Coord& origin, std::string_view children, std::string_view on,
                   std::string_view bytes) {
        using Mask = typename Node::NodeMaskType;
        const Mask child_mask = mask_from<Mask>(children), on_mask = mask_from<Mask>(on);
        VdbByteStream in(skeleton_, entry_, bytes);
        openvdb::io::setGridBackgroundValuePtr(in, &background_);
        std::vector<float> values(Node::NUM_VALUES);
        openvdb::io::readCompressedValues(in, values.data(), Node::NUM_VALUES, on_mask, entry_.half);
        if (!in) cursor_.fail("the values of a node cannot be read");
        constexpr int step = Node::ChildNodeType::DIM;
        for (openvdb::Index n = 0; n < Node::NUM_VALUES; ++n) {
            if (child_mask.isOn(n)) continue;
            const bool is_on = on_mask.isOn(n);
            if (!is_on && std::memcmp(&values[n], &background_, sizeof background_) == 0) continue;
            Coord local;
            Node::offsetToLocalCoord(n, local);
            tiles_.addTile(static_cast<openvdb::Index>(level),
                           origin.offsetBy(step * local.x(), step * local.y(), step * local.z()), values[n],
                           is_on);
        }
    }

    void expand(const Coord& origin, const Leaf::NodeMaskType& mask) {
        if (mask.isOn()) {
            box.expand(CoordBBox::createCube(origin, Leaf::DIM));
            return;
        }
        std::uint64_t slices = 0;  // words are slices of x; bits in them 8 y + z
        int low = 8, high = -1;
        for (int x = 0; x < 8; ++x)
            if (const std::uint64_t word = mask.getWord<std::uint64_t>(static_cast<openvdb::Index>(x))) {
                low = std::min(low, x);
                high = x;
                slices |= word;
            }
        std::uint64_t row = slices | slices >> 32;
        row |= row >> 16;
        row = (row | row >> 8) & 0xFF;
        const Coord from(low, __builtin_ctzll(slices) / 8, __builtin_ctzll(row));
        const Coord to(high, 7 - __builtin_clzll(slices) / 8, 63 - __builtin_clzll(row));
        box.expand(CoordBBox(origin + from, origin + to));
    }

    const VdbSkeleton& skeleton_;
    const VdbEntry& entry_;
    const VdbCursor& cursor_;
    FloatTree& tiles_;
    float background_ = 0;
    std::vector<Coord> origins_;
    std::uint64_t noted_ = 0;  // leaves whose nodes were met
    std::size_t run_ = 0;      // that of the next leaf
    openvdb::Index slot_ = 0;  // the last leaf's in it
};

}  // namespace

struct VdbSections::State {
    State(const std::filesystem::path& path, const std::optional<std::string>& name)
        : file(path), cursor(file, true), skeleton(walk_vdb(cursor)), grid(FloatGrid::create()) {
        for (const VdbEntry& e : skeleton.grids) check_noted_box(file.name(), e.info);
        const VdbEntry& entry = choose_vdb_grid(file.name(), skeleton.grids, name);
        cursor.enter("'" + entry.info.name + "'");
        owner = &owner_of_tree(cursor, skeleton.grids, entry);
        try {
            load(entry);
        } catch (const openvdb::Exception& e) {
            cursor.fail(e.what());
        }
        file.release();
    }

    void load(const VdbEntry& entry) {
        if (owner != &entry) check_vdb_tree(cursor, entry);
        notes.emplace(skeleton, *owner, cursor, grid->tree());
        check_vdb_tree(cursor, *owner, &*notes);
        static_cast<openvdb::MetaMap&>(*grid) = entry.info.metadata;
        VdbByteStream transform(skeleton, entry, cursor.from(entry.transform_at));
        grid->readTransform(transform);
        const std::uint64_t active = grid->activeVoxelCount() + notes->active;
        CoordBBox box = grid->evalActiveVoxelBoundingBox();
        if (!notes->box.empty()) box.expand(notes->box);
        check_voxels(file.name(), entry.info, active, box);
        active_voxels = active;
        active_box = box;
        try {
            frame = map_from_grid(grid).frame;
        } catch (const InvalidInput& e) {
            throw InvalidInput(fmt::format("{}: grid '{}': {}", file.name(), grid->getName(), e.what()));
        }
    }

    LeafLookup lookup() const;
    /// Copies of the leaves in a box of one node.
    std::vector<std::unique_ptr<Leaf>> leaves_in(const CoordBBox& box) const;

    MappedFile file;
    VdbCursor cursor;
    VdbSkeleton skeleton;
    FloatGrid::Ptr grid;
    const VdbEntry* owner = nullptr;  // of the tree
    std::optional<Notes> notes;
    Frame frame;
    std::uint64_t active_voxels = 0;
    CoordBBox active_box;
};

namespace {

/// Decodes leaves for one thread.
class LeafReader {
 public:
    LeafReader(const MappedFile& file, const VdbSkeleton& skeleton, const VdbEntry& entry, const Notes& notes,
               const FloatGrid& tiles)
        : file_(file),
          notes_(notes),
          half_(entry.half),
          background_(notes.background()),
          stream_(skeleton, entry, {}),
          tiles_(tiles.getConstAccessor()) {
        openvdb::io::setGridBackgroundValuePtr(stream_, &background_);
    }

    const Leaf* operator()(const Coord& corner, float& tile) {
        const Coord origin = corner & ~127;
        if (!run_known_ || origin != origin_) {
            const auto found = notes_.run_at.find(origin);
            run_ = found == notes_.run_at.end() ? nullptr : &notes_.runs[found->second];
            origin_ = origin;
            run_known_ = true;
        }
        const openvdb::Index slot = LowerNode::coordToOffset(corner);
        if (!run_ || !run_->children.isOn(slot)) {
            tile = tiles_.getValue(corner);
            return nullptr;
        }
        return decode(*run_, slot, corner);
    }

 private:
    const Leaf* decode(const LeafRun& run, openvdb::Index slot, const Coord& corner) {
        std::uint64_t rank = 0;  // children before this one
        for (openvdb::Index w = 0; w < slot / 64; ++w)
            rank += static_cast<unsigned>(__builtin_popcountll(run.children.getWord<std::uint64_t>(w)));
        const std::uint64_t below = (std::uint64_t(1) << slot % 64) - 1;
        rank += static_cast<unsigned>(
            __builtin_popcountll(run.children.getWord<std::uint64_t>(slot / 64) & below));
        const std::uint64_t begin = rank == 0 ? 0 : notes_.ends[run.first + rank - 1];
        bytes_.resize(notes_.ends[run.first + rank] - begin);
        file_.read_at(run.buffers_at + begin, bytes_.data(), bytes_.size());
        stream_.restart(bytes_);
        try {
            leaf_.readBuffers(stream_, half_);
        } catch (const openvdb::Exception& e) {
            throw InvalidInput(fmt::format("{}: damaged VDB file: a leaf at byte {}: {}", file_.name(),
                                           run.buffers_at + begin, e.what()));
        }
        if (!stream_ || stream_.position() != bytes_.size())
            throw InvalidInput(fmt::format("{}: damaged VDB file: the voxels cannot be read (byte {})",
                                           file_.name(), run.buffers_at + begin));
        leaf_.setOrigin(corner);
        return &leaf_;
    }

    const MappedFile& file_;
    const Notes& notes_;
    bool half_;
    float background_;
    VdbByteStream stream_;
    FloatGrid::ConstAccessor tiles_;
    std::string bytes_;
    Leaf leaf_;
    const LeafRun* run_ = nullptr;
    Coord origin_;
    bool run_known_ = false;
};

}  // namespace

LeafLookup VdbSections::State::lookup() const {
    const auto reader = std::make_shared<LeafReader>(file, skeleton, *owner, *notes, *grid);
    return [reader](const Coord& corner, float& tile) -> const float* {
        const Leaf* leaf = (*reader)(corner, tile);
        return leaf ? leaf->buffer().data() : nullptr;
    };
}

std::vector<std::unique_ptr<Leaf>> VdbSections::State::leaves_in(const CoordBBox& box) const {
    LeafReader reader(file, skeleton, *owner, *notes, *grid);
    std::vector<std::unique_ptr<Leaf>> leaves;
    Coord at;
    float tile = 0;
    for (at.x() = box.min().x(); at.x() <= box.max().x(); at.x() += Leaf::DIM)
        for (at.y() = box.min().y(); at.y() <= box.max().y(); at.y() += Leaf::DIM)
            for (at.z() = box.min().z(); at.z() <= box.max().z(); at.z() += Leaf::DIM)
                if (const Leaf* leaf = reader(at, tile)) leaves.push_back(std::make_unique<Leaf>(*leaf));
    return leaves;
}

VdbSections::Leaves VdbSections::leaf_reader() const {
    const State& s = *state_;
    const auto reader = std::make_shared<LeafReader>(s.file, s.skeleton, *s.owner, *s.notes, *s.grid);
    return [reader](const Coord& corner, float& tile) { return (*reader)(corner, tile); };
}

FloatGrid::Ptr VdbSections::empty_grid() const {
    const FloatGrid& grid = *state_->grid;
    FloatGrid::Ptr empty = grid.copyWithNewTree();
    // Shared: a copy of a transform rounds its scale.
    empty->setTransform(std::const_pointer_cast<openvdb::math::Transform>(grid.constTransformPtr()));
    return empty;
}

void sort_pieces(std::vector<CoordBBox>& pieces) {
    const auto before = [](const CoordBBox& a, const CoordBBox& b) {
        constexpr int inside = UpperNode::DIM - 1;
        return std::pair(a.min() & ~inside, a.min()) < std::pair(b.min() & ~inside, b.min());
    };
    std::sort(pieces.begin(), pieces.end(), before);
    pieces.erase(std::unique(pieces.begin(), pieces.end()), pieces.end());
}

std::vector<CoordBBox> VdbSections::pieces() const {
    const FloatTree& tiles = state_->grid->tree();
    std::vector<CoordBBox> all;
    for (const auto& [origin, run] : state_->notes->run_at)
        all.push_back(CoordBBox::createCube(origin, LowerNode::DIM));
    std::vector<const LowerNode*> lower;
    tiles.getNodes(lower);
    for (const LowerNode* node : lower) all.push_back(node->getNodeBoundingBox());
    auto tile = tiles.cbeginValueAll();
    tile.setMaxDepth(FloatTree::ValueAllCIter::LEAF_DEPTH - 2);
    for (; tile; ++tile)
        if (tile.isValueOn() || *tile != tiles.background()) all.push_back(tile.getBoundingBox());
    sort_pieces(all);
    return all;
}

void VdbSections::copy_to(const CoordBBox& box, FloatTree& to, const Progress& progress) const {
    const State& s = *state_;
    const CoordBBox wanted = whole_leaves(box);
    std::vector<CoordBBox> slices;  // of nodes, eight voxels thick
    for (const auto& [origin, run] : s.notes->run_at) {
        CoordBBox inside = CoordBBox::createCube(origin, LowerNode::DIM);
        inside.intersect(wanted);
        if (inside.empty()) continue;
        for (int x = inside.min().x(); x <= inside.max().x(); x += Leaf::DIM) {
            slices.push_back(inside);
            slices.back().min().x() = x;
            slices.back().max().x() = x + Leaf::DIM - 1;
        }
    }
    constexpr std::size_t together = 64;
    std::vector<std::vector<std::unique_ptr<Leaf>>> found(together);
    for (std::size_t first = 0; first < slices.size(); first += together) {
        const std::size_t count = std::min(together, slices.size() - first);
        parallel_for(count, 1, [&](std::size_t i) { found[i] = s.leaves_in(slices[first + i]); });
        for (std::size_t i = 0; i < count; ++i)
            for (auto& leaf : found[i]) to.addLeaf(leaf.release());
        progress.report(static_cast<double>(first + count) / static_cast<double>(slices.size()));
    }
    copy_tiles(s.grid->tree(), box, to);
}

VdbSections::VdbSections(const std::filesystem::path& path, const std::optional<std::string>& grid) {
    openvdb::initialize();
    state_ = std::make_unique<State>(path, grid);
}

VdbSections::~VdbSections() = default;
VdbSections::VdbSections(VdbSections&&) noexcept = default;

const FloatGrid& VdbSections::grid() const { return *state_->grid; }
const Frame& VdbSections::frame() const { return state_->frame; }
std::uint64_t VdbSections::active_voxels() const { return state_->active_voxels; }
std::uint64_t VdbSections::leaves() const { return state_->notes->ends.size(); }
const CoordBBox& VdbSections::active_box() const { return state_->active_box; }

std::uint64_t VdbSections::memory() const {
    const Notes& n = *state_->notes;
    return n.ends.capacity() * sizeof n.ends[0] + n.runs.capacity() * sizeof n.runs[0] + n.runs.size() * 80 +
           state_->grid->memUsage();
}

DenseSections VdbSections::sections(const Vec3i& first, const Vec3i& size,
                                    const std::array<int, 3>& order) const {
    return {[state = state_.get()] { return state->lookup(); }, first, size, order};
}

MrcWriteReport write_mrc(const VdbSections& grid, const std::filesystem::path& path,
                         const MrcWriteOptions& options, const Progress& progress) {
    return write_mrc_from(
        grid.grid(), grid.frame(), grid.active_box(), path, options,
        [&](const MrcBox& box, const std::array<int, 3>& order) {
            return grid.sections(box.first, box.frame.size, order);
        },
        progress);
}

}  // namespace vdbgeo
