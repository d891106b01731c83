// Trees as OpenVDB's file format 222 and later stores them: the nodes' masks and values depth first, then the
// leaves' voxels in the same order.
#include <fmt/format.h>
#include <openvdb/io/Compression.h>

#include <array>
#include <cmath>
#include <set>

#include "converters/vdb_skeleton.h"

namespace vdbgeo {
namespace {

namespace io = openvdb::io;

constexpr std::uint64_t leaf_voxels = 512;
constexpr std::int32_t root_step = 4096;                  // voxels along a child of the root
constexpr std::int32_t lower_step = 128;                  // and along a child of that
constexpr std::int32_t furthest = std::int32_t(1) << 30;  // so that sizes of boxes fit 32 bits

struct ValueType {
    const char* tree;
    std::uint64_t bytes, half_bytes;  // half_bytes 0: never stored as half floats
};
constexpr std::array<ValueType, 7> value_types{{{"Tree_float_5_4_3", 4, 2},
                                                {"Tree_double_5_4_3", 8, 2},
                                                {"Tree_int32_5_4_3", 4, 0},
                                                {"Tree_int64_5_4_3", 8, 0},
                                                {"Tree_vec3s_5_4_3", 12, 6},
                                                {"Tree_vec3d_5_4_3", 24, 6},
                                                {"Tree_vec3i_5_4_3", 12, 0}}};

class TreeWalk {
 public:
    TreeWalk(VdbCursor& cursor, const VdbEntry& entry, VdbTreeVisitor* visitor)
        : c_(cursor), entry_(entry), visitor_(visitor) {
        for (const ValueType& type : value_types)
            if (entry.info.type == type.tree || entry.info.type == std::string(type.tree) + "_HalfFloat") {
                bytes_ = type.bytes;
                half_ = entry.half && type.half_bytes != 0;
                stored_bytes_ = half_ ? type.half_bytes : type.bytes;
            }
        if (bytes_ == 0) c_.fail(fmt::format("trees of type {} cannot be read", entry.info.type));
    }

    VdbTreeLayout walk() {
        VdbTreeLayout layout;
        c_.seek(entry_.transform_at);
        transform();
        layout.tree_at = c_.at();
        if (!entry_.parent.empty()) {
            expect_at(entry_.end_at, "the end of the grid");
            return layout;
        }
        root();
        expect_at(entry_.block_at, "its voxels");
        for (const std::uint64_t run : leaf_masks_)
            for (std::uint64_t i = 0; i < leaves_of(run); ++i, ++layout.leaves) {
                if (layout.leaves % VdbTreeLayout::chunk == 0) layout.chunk_at.push_back(c_.at());
                leaf(c_.from(first_mask(run) + i * mask_bytes).data());
            }
        expect_at(entry_.end_at, "the end of the grid");
        return layout;
    }

 private:
    using Position = std::array<std::int32_t, 3>;
    static openvdb::Coord coord(const Position& p) { return {p[0], p[1], p[2]}; }

    static constexpr std::uint64_t mask_bytes = leaf_voxels / 8;

    // The leaves of one lower node: where their masks begin, and how many there are (at most 4096).
    static std::uint64_t pack(std::uint64_t at, std::uint64_t count) { return at << 13 | count; }
    static std::uint64_t first_mask(std::uint64_t run) { return run >> 13; }
    static std::uint64_t leaves_of(std::uint64_t run) { return run & 0x1FFF; }

    void expect_at(std::uint64_t position, const char* what) const {
        if (position != 0 && position != c_.at())
            c_.fail(fmt::format("its nodes end here, but its descriptor has {} at byte {}", what, position));
    }

    void transform() {
        const std::string type = c_.string("type of the transform");
        if (type == "AffineMap" || type == "UnitaryMap")
            finite(16);
        else if (type == "TranslationMap")
            finite(3);
        else if (type == "ScaleMap" || type == "UniformScaleMap")
            scales();
        else if (type == "ScaleTranslateMap" || type == "UniformScaleTranslateMap")
            finite(3), scales();
        else if (type == "NonlinearFrustumMap")
            c_.fail("its transform is not linear (a frustum)");
        else
            c_.fail(fmt::format("a transform of type '{}' is not known", type.substr(0, 40)));
    }

    void finite(int count) {
        for (int i = 0; i < count; ++i)
            if (!std::isfinite(c_.number<double>("transform"))) c_.fail("its transform is not finite");
    }

    /// The scale, then numbers that follow from it and are stored all the same.
    void scales() {
        std::array<double, 15> v;
        for (double& value : v) value = c_.number<double>("transform");
        const auto far_from = [](double a, double b) { return !(std::abs(a - b) <= 1e-9 * std::abs(b)); };
        for (std::size_t a = 0; a < 3; ++a) {
            const double s = v[a], inverse = 1 / s;
            if (s == 0 || !std::isfinite(s) || far_from(v[3 + a], std::abs(s)) ||
                far_from(v[6 + a], inverse) || far_from(v[9 + a], inverse * inverse) ||
                far_from(v[12 + a], inverse / 2))
                c_.fail(fmt::format("its transform contradicts itself (scale {} along {})", s, "xyz"[a]));
        }
    }

    void root() {
        const auto buffers = c_.number<std::int32_t>("number of buffers");
        if (buffers != 1) c_.fail(fmt::format("{} buffers a leaf", buffers));
        const char* background = c_.take(bytes_, "background");
        if (visitor_) visitor_->background(background);
        const auto tiles = c_.number<std::uint32_t>("number of tiles");
        const auto children = c_.number<std::uint32_t>("number of nodes");
        if (tiles > c_.left() / (13 + bytes_)) c_.fail(fmt::format("{} tiles", tiles));
        std::set<Position> seen;
        for (std::uint32_t i = 0; i < tiles; ++i) {
            const Position here = position();
            if (!seen.insert(here).second) c_.fail("two tiles in one place");
            const char* value = c_.take(bytes_, "tile");
            const auto active = c_.number<std::uint8_t>("tile");
            if (active > 1) c_.fail("a tile is neither active nor inactive");
            if (visitor_) visitor_->root_tile(coord(here), value, active != 0);
        }
        Position last{INT32_MIN, INT32_MIN, INT32_MIN};
        for (std::uint32_t i = 0; i < children; ++i) {
            const Position here = position();
            // OpenVDB reads the voxels in the order of the positions, whatever that of the nodes was.
            if (here <= last) c_.fail("nodes out of order");
            if (seen.count(here) != 0) c_.fail("a tile and a node in one place");
            last = here;
            upper_node(coord(here));
        }
    }

    Position position() {
        Position p;
        for (std::int32_t& v : p) {
            v = c_.number<std::int32_t>("position of a node");
            if (v % root_step != 0 || v < -furthest || v > furthest)
                c_.fail(fmt::format("a node at {}, which is not a multiple of {} in range", v, root_step));
        }
        return p;
    }

    void upper_node(const openvdb::Coord& origin) {
        const std::string_view children = node_head(2, 32768, origin);
        for (std::size_t byte = 0; byte < children.size(); ++byte)
            for (std::size_t bit = 0; bit < 8; ++bit)
                if (children[byte] >> bit & 1) {
                    const int n = static_cast<int>(8 * byte + bit);  // z runs fastest
                    lower_node(origin.offsetBy(lower_step * (n >> 10), lower_step * (n >> 5 & 31),
                                               lower_step * (n & 31)));
                }
    }

    void lower_node(const openvdb::Coord& origin) {
        const std::uint64_t leaves = count_on(node_head(1, 4096, origin));
        if (leaves == 0) return;
        leaf_masks_.push_back(pack(c_.at(), leaves));
        c_.take(leaves * mask_bytes, "masks of leaves");
    }

    /// Masks and values of an internal node; the mask of its children comes back.
    std::string_view node_head(int level, std::uint64_t slots, const openvdb::Coord& origin) {
        const std::string_view children(c_.take(slots / 8, "mask of a node"), slots / 8);
        const std::string_view active(c_.take(slots / 8, "mask of a node"), slots / 8);
        for (std::size_t i = 0; i < children.size(); ++i)
            if ((children[i] & active[i]) != 0) c_.fail("the masks of a node contradict each other");
        const std::uint64_t values_at = c_.at();
        values(active);
        if (visitor_) visitor_->node(level, origin, children, active, values_at, c_.at());
        return children;
    }

    void leaf(const char* mask_in_topology) {
        const std::uint64_t begin = c_.at();
        const std::string_view mask(c_.take(mask_bytes, "mask of a leaf"), mask_bytes);
        if (std::memcmp(mask.data(), mask_in_topology, mask_bytes) != 0)
            c_.fail("a leaf's two masks of active voxels are not the same");
        values(mask);
        if (visitor_) visitor_->leaf(mask, begin, c_.at());
    }

    /// The values of a node: a flag that tells which inactive ones were left out, those, and one block.
    void values(std::string_view active) {
        const auto flag = c_.number<std::uint8_t>("values of a node");
        if (flag > io::NO_MASK_AND_ALL_VALS) c_.fail(fmt::format("a node's values are of kind {}", flag));
        if (flag == io::NO_MASK_AND_ONE_INACTIVE_VAL || flag == io::MASK_AND_ONE_INACTIVE_VAL)
            c_.take(bytes_, "inactive value");
        if (flag == io::MASK_AND_TWO_INACTIVE_VALS) c_.take(2 * bytes_, "inactive values");
        if (flag == io::MASK_AND_NO_INACTIVE_VALS || flag == io::MASK_AND_ONE_INACTIVE_VAL ||
            flag == io::MASK_AND_TWO_INACTIVE_VALS)
            c_.take(active.size(), "mask of inactive values");
        const bool only_active =
            (entry_.compression & io::COMPRESS_ACTIVE_MASK) != 0 && flag != io::NO_MASK_AND_ALL_VALS;
        block(only_active ? count_on(active) : 8 * active.size());
    }

    void block(std::uint64_t count) {
        if (half_ && count == 0) return;
        const std::uint64_t plain = count * stored_bytes_;
        const bool blosc = (entry_.compression & io::COMPRESS_BLOSC) != 0;
        if (!blosc && (entry_.compression & io::COMPRESS_ZIP) == 0) {
            c_.take(plain, "values of a node");
            return;
        }
        const auto packed = c_.number<std::int64_t>("length of a compressed block");
        if (packed <= 0) {  // did not become smaller, and is not compressed
            if (packed != -static_cast<std::int64_t>(plain))
                c_.fail(fmt::format("a block of {} bytes where {} belong", packed, plain));
            c_.take(plain, "values of a node");
            return;
        }
        const char* bytes = c_.take(static_cast<std::uint64_t>(packed), "compressed values of a node");
        if (!blosc) return;      // zip checks its own length
        std::uint32_t sizes[3];  // of Blosc's header: unpacked, of a block, packed
        if (packed >= 16) std::memcpy(sizes, bytes + 4, sizeof sizes);
        if (packed < 16 || sizes[0] != plain || sizes[2] != static_cast<std::uint64_t>(packed))
            c_.fail("a compressed block contradicts its length");
    }

    static std::uint64_t count_on(std::string_view mask) {
        std::uint64_t count = 0;
        for (std::size_t i = 0; i < mask.size(); i += 8) {
            std::uint64_t word;
            std::memcpy(&word, mask.data() + i, 8);
            count += static_cast<std::uint64_t>(__builtin_popcountll(word));
        }
        return count;
    }

    VdbCursor& c_;
    const VdbEntry& entry_;
    VdbTreeVisitor* visitor_;
    std::uint64_t bytes_ = 0, stored_bytes_ = 0;
    bool half_ = false;
    std::vector<std::uint64_t> leaf_masks_;
};

}  // namespace

VdbTreeLayout check_vdb_tree(VdbCursor& cursor, const VdbEntry& entry, VdbTreeVisitor* visitor) {
    return TreeWalk(cursor, entry, visitor).walk();
}

}  // namespace vdbgeo
