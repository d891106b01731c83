#include "vdbgeo/surface/label_net.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/label_cells.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using label_cell::Labels;
using openvdb::Coord;
using openvdb::CoordBBox;
using Vec3 = Eigen::Vector3f;

constexpr int dim = leaf::dim;
constexpr std::size_t chunk = 16;  // blocks a task

/// How far the surface goes towards the middle of a layer that is one voxel thick; how far the sheets of one
/// cell stay from the planes through its middle, and the lines of a neck from its axis.
constexpr float half_thickness = 0.25f, sheet_gap = 0.05f, neck = 0.15f;

/// The labels of a block of 8³ cells, their corners, and a layer around.
class Samples {
 public:
    float at(int x, int y, int z) const {
        return values_[static_cast<std::size_t>(((x + 1) * side + y + 1) * side + z + 1)];
    }
    float at(const Coord& c) const { return at(c.x(), c.y(), c.z()); }
    Labels cell(const Coord& c) const {
        Labels out;
        for (int k = 0; k < 8; ++k)
            out[static_cast<std::size_t>(k)] =
                at(c.x() + (k & 1), c.y() + (k >> 1 & 1), c.z() + (k >> 2 & 1));
        return out;
    }

    template <class Accessor>
    void load(const Accessor& accessor, const Coord& origin, const CoordBBox& box) {
        for (int lx = -1; lx < 2; ++lx)
            for (int ly = -1; ly < 2; ++ly)
                for (int lz = -1; lz < 2; ++lz) load_leaf(accessor, origin, Coord(lx, ly, lz));
        if (box.isInside(CoordBBox(origin.offsetBy(-1), origin.offsetBy(dim + 1)))) return;
        for (int x = -1; x <= dim + 1; ++x)
            for (int y = -1; y <= dim + 1; ++y)
                for (int z = -1; z <= dim + 1; ++z)
                    if (!box.isInside(origin.offsetBy(x, y, z))) value(x, y, z) = 0;
    }

    /// Whether the corners of the block's cells all have one label.
    bool uniform() const {
        const float first = at(0, 0, 0);
        for (int x = 0; x <= dim; ++x)
            for (int y = 0; y <= dim; ++y)
                for (int z = 0; z <= dim; ++z)
                    if (at(x, y, z) != first) return false;
        return true;
    }

 private:
    static constexpr int side = dim + 3;

    float& value(int x, int y, int z) {
        return values_[static_cast<std::size_t>(((x + 1) * side + y + 1) * side + z + 1)];
    }

    template <class Accessor>
    void load_leaf(const Accessor& accessor, const Coord& origin, const Coord& place) {
        const Coord corner = origin + Coord(place.x() * dim, place.y() * dim, place.z() * dim);
        const auto* leaf = accessor.probeConstLeaf(corner);
        const float* values = leaf ? leaf->buffer().data() : nullptr;
        const float tile = leaf ? 0 : accessor.getValue(corner);
        Coord from, to;
        for (int a = 0; a < 3; ++a) {
            from[a] = place[a] < 0 ? dim - 1 : 0;
            to[a] = place[a] > 0 ? 1 : dim - 1;
        }
        for (int x = from.x(); x <= to.x(); ++x)
            for (int y = from.y(); y <= to.y(); ++y)
                for (int z = from.z(); z <= to.z(); ++z)
                    value(place.x() * dim + x, place.y() * dim + y, place.z() * dim + z) =
                        values ? values[leaf::offset(x, y, z)] : tile;
    }

    std::array<float, static_cast<std::size_t>(side* side* side)> values_;
};

/// A cell whose corners are not all of one label.
struct Cell {
    VertexId first = 0;        // its first vertex: one a sheet, then two for each lower face with a neck
    std::uint32_t sheets = 0;  // two bits an edge
    std::uint8_t count = 0;
    std::uint8_t necks = 0;    // bit a: the lower face across axis a has one
    bool many_labels = false;  // more than two
    VertexId neck_vertex(int axis) const {
        const int before = (necks & 1) * (axis > 0) + (necks >> 1 & 1) * (axis > 1);
        return first + count + static_cast<VertexId>(2 * before);
    }
    int sheet(int edge) const { return static_cast<int>(sheets >> (2 * edge) & 3u); }
};

struct Block {
    Coord origin;
    std::array<std::uint8_t, leaf::rows> present{};  // bit z: the cell has vertices
    std::array<std::uint16_t, leaf::rows> row_first{};
    std::vector<Cell> cells;
    std::uint64_t edges = 0, polygons = 0, first_vertex = 0, first_edge = 0, first_polygon = 0;
    std::vector<std::array<VertexId, 4>> side_vertices;

    const Cell& cell(const Coord& c) const {
        const auto row = static_cast<std::size_t>(leaf::row(c.x(), c.y()));
        const unsigned below = present[row] & ((1u << c.z()) - 1);
        return cells[row_first[row] + static_cast<std::size_t>(__builtin_popcount(below))];
    }
};

Coord step(const Coord& c, int axis, int by) {
    Coord out = c;
    out[axis] += by;
    return out;
}

class Builder {
 public:
    Builder(const DensityMap& map, double max_shift, const Progress& progress)
        : tree_(map.grid->constTree()),
          box_(map.frame.bounded() ? CoordBBox(Coord(0), Coord(map.frame.size.x() - 1, map.frame.size.y() - 1,
                                                               map.frame.size.z() - 1))
                                   : CoordBBox::inf()),
          shift_(0.98f * static_cast<float>(max_shift)),
          progress_(progress) {
        if (!map.frame.bounded() && tree_.background() != 0)
            throw InvalidInput(fmt::format("the background of an unbounded grid of labels is {}, not 0",
                                           tree_.background()));
    }

    LabelNet run() {
        collect_labels();
        collect_blocks();
        for_each_block(0.1, 0.4, [&](Block& block, const Samples& s) { find_cells(block, s); });
        blocks_.erase(
            std::remove_if(blocks_.begin(), blocks_.end(), [](const Block& b) { return b.cells.empty(); }),
            blocks_.end());
        number();
        for_each_block(0.4, 1, [&](Block& block, const Samples& s) { fill(block, s); });
        for (Block& block : blocks_) {
            const auto shift = static_cast<std::int32_t>(net_.side_vertices.size());
            if (block.side_vertices.empty()) continue;
            for (std::uint64_t p = 0; p < block.polygons; ++p)
                if (std::int32_t& extra = net_.polygons[block.first_polygon + p].extra; extra >= 0)
                    extra += shift;
            net_.side_vertices.insert(net_.side_vertices.end(), block.side_vertices.begin(),
                                      block.side_vertices.end());
        }
        return std::move(net_);
    }

 private:
    template <class Body>
    void for_each_block(double from, double to, const Body& body) {
        const Progress progress = progress_.part(from, to);
        parallel_blocks(blocks_.size(), chunk, [&](std::size_t begin, std::size_t end) {
            const openvdb::tree::ValueAccessor<const openvdb::FloatTree> accessor(tree_);
            Samples samples;
            for (std::size_t b = begin; b < end; ++b) {
                samples.load(accessor, blocks_[b].origin, box_);
                body(blocks_[b], samples);
            }
            if ((begin / chunk) % 64 == 0)
                progress.report(static_cast<double>(begin) / static_cast<double>(blocks_.size()));
        });
        progress.report(1);
    }

    void add_label(float value, const Coord& at) {
        if (!(std::trunc(value) == value) || std::abs(value) > 0x1p62f)
            throw InvalidInput(
                fmt::format("a map of labels holds {} at voxel ({}, {}, {}): labels are whole numbers", value,
                            at.x(), at.y(), at.z()));
        labels_.insert(value);
    }

    /// Looks at every sample once.
    void collect_labels() {
        labels_.insert(0.0f);
        if (!(box_ == CoordBBox::inf())) add_label(tree_.background(), Coord(0));
        float last = 0;
        for (auto leaf = tree_.cbeginLeaf(); leaf; ++leaf) {
            const bool inside = box_.isInside(leaf->getNodeBoundingBox());
            const float* values = leaf->buffer().data();
            for (openvdb::Index i = 0; i < leaf::size; ++i) {
                if (values[i] == last || (!inside && !box_.isInside(leaf->offsetToGlobalCoord(i)))) continue;
                add_label(values[i], leaf->offsetToGlobalCoord(i));
                last = values[i];
            }
        }
        net_.labels.assign(labels_.begin(), labels_.end());
    }

    /// Blocks that hold cells of the border layer of a box of equal samples.
    void add_shell(CoordBBox tile) {
        tile.intersect(box_);
        if (tile.empty()) return;
        const Coord low = tile.min().offsetBy(-1) & ~(dim - 1), high = tile.max() & ~(dim - 1);
        for (int x = low.x(); x <= high.x(); x += dim)
            for (int y = low.y(); y <= high.y(); y += dim) {
                const bool side = x == low.x() || x == high.x() || y == low.y() || y == high.y();
                for (int z = low.z(); z <= high.z(); z += side ? dim : std::max(dim, high.z() - low.z()))
                    origins_.emplace_back(x, y, z);
            }
    }

    void collect_blocks() {
        for (auto leaf = tree_.cbeginLeaf(); leaf; ++leaf)
            for (int k = 0; k < 8; ++k)
                origins_.push_back(
                    leaf->origin().offsetBy(-dim * (k & 1), -dim * (k >> 1 & 1), -dim * (k >> 2)));
        auto tile = tree_.cbeginValueAll();
        tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (*tile == tree_.background()) continue;
            CoordBBox at;
            tile.getBoundingBox(at);
            add_label(*tile, at.min());
            add_shell(at);
        }
        net_.labels.assign(labels_.begin(), labels_.end());
        if (tree_.background() != 0) add_shell(box_);
        std::sort(origins_.begin(), origins_.end());
        origins_.erase(std::unique(origins_.begin(), origins_.end()), origins_.end());
        blocks_.resize(origins_.size());
        for (std::size_t b = 0; b < blocks_.size(); ++b) blocks_[b].origin = origins_[b];
        progress_.report(0.1);
    }

    /// Whether the lower face of the cell across the axis is parted in two and both parts join the same two
    /// vertices. The neck between them then gets vertices of its own in the face.
    static bool has_neck(const Samples& s, const Coord& c, int axis, const label_cell::Sheets& sheets) {
        const Labels labels = s.cell(c);
        const label_cell::FaceParts parts = label_cell::face_parts(labels, 2 * axis);
        if (!parts.parted) return false;
        const auto sheet_of = [](const label_cell::Sheets& of, int face, int k) {
            const auto q = label_cell::face_corners(face);
            const auto at = static_cast<std::size_t>(k);
            return of.of_edge[static_cast<std::size_t>(label_cell::edge_between(q[at], q[(at + 1) % 4]))];
        };
        if (sheet_of(sheets, 2 * axis, parts.cut[0]) != sheet_of(sheets, 2 * axis, parts.cut[1]))
            return false;
        const label_cell::Sheets below = label_cell::sheets(s.cell(step(c, axis, -1)));
        return sheet_of(below, 2 * axis + 1, parts.cut[0]) == sheet_of(below, 2 * axis + 1, parts.cut[1]);
    }

    static void find_cells(Block& block, const Samples& s) {
        if (s.uniform()) return;
        for (int x = 0; x < dim; ++x)
            for (int y = 0; y < dim; ++y) {
                const auto row = static_cast<std::size_t>(leaf::row(x, y));
                block.row_first[row] = static_cast<std::uint16_t>(block.cells.size());
                for (int z = 0; z < dim; ++z) {
                    const Labels labels = s.cell(Coord(x, y, z));
                    if (std::all_of(labels.begin(), labels.end(), [&](float v) { return v == labels[0]; }))
                        continue;
                    block.present[row] |= static_cast<std::uint8_t>(1 << z);
                    add_cell(block, s, Coord(x, y, z), labels);
                }
            }
    }

    static void add_cell(Block& block, const Samples& s, const Coord& c, const Labels& labels) {
        Cell cell;
        const label_cell::Sheets sheets = label_cell::sheets(labels);
        for (int e = 0; e < cell::edges; ++e)
            if (const int sheet = sheets.of_edge[static_cast<std::size_t>(e)]; sheet >= 0)
                cell.sheets |= static_cast<std::uint32_t>(sheet) << (2 * e);
        cell.count = static_cast<std::uint8_t>(sheets.count);
        const float* other =
            std::find_if(labels.begin(), labels.end(), [&](float v) { return v != labels[0]; });
        cell.many_labels =
            std::any_of(other, labels.end(), [&](float v) { return v != labels[0] && v != *other; });
        for (int a = 0; a < 3; ++a) {
            if (has_neck(s, c, a, sheets)) cell.necks |= static_cast<std::uint8_t>(1 << a);
            const label_cell::FaceParts parts = label_cell::face_parts(labels, 2 * a);
            const auto q = label_cell::face_corners(2 * a);
            bool any = false;
            for (std::size_t k = 0; k < 4; ++k)
                any = any || labels[static_cast<std::size_t>(q[k])] !=
                                 labels[static_cast<std::size_t>(q[(k + 1) % 4])];
            const bool has_two = cell.necks >> a & 1;
            block.edges += has_two ? 4 : parts.parted ? 2 : any;
            block.polygons += label_cell::crossed(labels, 4 * a);
        }
        block.cells.push_back(cell);
    }

    void number() {
        std::uint64_t vertices = 0, edges = 0, polygons = 0;
        for (Block& block : blocks_) {
            block.first_vertex = vertices;
            block.first_edge = edges;
            block.first_polygon = polygons;
            for (Cell& cell : block.cells) {
                cell.first = static_cast<VertexId>(vertices);
                vertices += cell.count + 2u * static_cast<unsigned>(__builtin_popcount(cell.necks));
            }
            edges += block.edges;
            polygons += block.polygons;
            at_.emplace(block.origin, &block);
        }
        if (vertices + polygons > TriMesh::max_vertices)
            throw InvalidInput(fmt::format("the surfaces have {} vertices, more than 2^32-1", vertices));
        net_.vertices.resize(vertices);
        net_.edges.resize(edges);
        net_.polygons.resize(polygons);
    }

    /// The cell at a place of a block or of one of its lower neighbours.
    const Cell& cell_at(const Block& block, const Coord& c) const {
        if (c.x() >= 0 && c.y() >= 0 && c.z() >= 0) return block.cell(c);
        const Coord low = c & ~(dim - 1);
        return at_.find(block.origin + low)->second->cell(c - low);
    }

    void fill(Block& block, const Samples& s) {
        NetEdge* edge = net_.edges.data() + block.first_edge;
        NetPolygon* polygon = net_.polygons.data() + block.first_polygon;
        for (int x = 0; x < dim; ++x)
            for (int y = 0; y < dim; ++y)
                for (unsigned left = block.present[static_cast<std::size_t>(leaf::row(x, y))]; left;
                     left &= left - 1) {
                    const Coord c(x, y, __builtin_ctz(left));
                    const Cell& cell = block.cell(c);
                    const Labels labels = s.cell(c);
                    place(block.origin, c, s, labels, cell);
                    for (int a = 0; a < 3; ++a) {
                        edge = add_edges(block, c, labels, cell, a, edge);
                        if (label_cell::crossed(labels, 4 * a)) *polygon++ = make_polygon(block, s, c, a);
                    }
                }
    }

    /// Vertices of the cell's sheets, and of the necks in its lower faces.
    void place(const Coord& origin, const Coord& c, const Samples& s, const Labels& labels,
               const Cell& cell) {
        const Coord at = origin + c;
        const Vec3 middle =
            Vec3(static_cast<float>(at.x()), static_cast<float>(at.y()), static_cast<float>(at.z())) +
            Vec3::Constant(0.5f);
        for (int sheet = 0; sheet < cell.count; ++sheet) {
            Vec3 mean = Vec3::Zero(), low = Vec3::Constant(-shift_), high = -low;
            int edges = 0;
            for (int e = 0; e < cell::edges; ++e) {
                if (!label_cell::crossed(labels, e) || cell.sheet(e) != sheet) continue;
                const int from = cell::lower_corner(e), a = e / 4;
                for (int b = 0; b < 3; ++b) mean[b] += b == a ? 0 : static_cast<float>(from >> b & 1) - 0.5f;
                ++edges;
                const Coord p = c.offsetBy(from & 1, from >> 1 & 1, from >> 2 & 1), q = step(p, a, 1);
                if (s.at(step(p, a, -1)) != s.at(p)) low[a] = std::max(low[a], -half_thickness);
                if (s.at(step(q, a, 1)) != s.at(q)) high[a] = std::min(high[a], half_thickness);
            }
            Vec3 start = Vec3::Zero();
            if (cell.count > 1) {
                mean /= static_cast<float>(edges);
                for (int a = 0; a < 3; ++a) {
                    if (std::abs(mean[a]) < 0.01f) continue;
                    (mean[a] < 0 ? high : low)[a] = mean[a] < 0 ? -sheet_gap : sheet_gap;
                }
                start = mean.cwiseMax(low).cwiseMin(high);
            }
            net_.vertices[cell.first + static_cast<VertexId>(sheet)] = {middle + start, middle + low,
                                                                        middle + high};
        }
        for (int a = 0; a < 3; ++a)
            if (cell.necks >> a & 1) place_neck(middle, labels, a, cell.neck_vertex(a));
    }

    void place_neck(const Vec3& middle, const Labels& labels, int axis, VertexId first) {
        const auto q = label_cell::face_corners(2 * axis);
        for (const int k : label_cell::face_parts(labels, 2 * axis).cut) {
            const int corner = q[static_cast<std::size_t>(k)];
            Vec3 start = Vec3::Zero(), low = Vec3::Constant(-half_thickness), high = -low;
            start[axis] = -0.5f;
            low[axis] -= 0.5f;
            high[axis] -= 0.5f;
            for (const int a : {(axis + 1) % 3, (axis + 2) % 3}) {
                const bool up = corner >> a & 1;
                start[a] = up ? 0.25f : -0.25f;
                (up ? low : high)[a] = up ? neck : -neck;
            }
            net_.vertices[first++] = {middle + start, middle + low, middle + high};
        }
    }

    /// Sides of polygons that cross the cell's lower face.
    NetEdge* add_edges(const Block& block, const Coord& c, const Labels& labels, const Cell& cell, int axis,
                       NetEdge* out) const {
        const auto q = label_cell::face_corners(2 * axis);
        const auto edge = [&](int k) {
            return label_cell::edge_between(q[static_cast<std::size_t>(k % 4)],
                                            q[static_cast<std::size_t>((k + 1) % 4)]);
        };
        const label_cell::FaceParts parts = label_cell::face_parts(labels, 2 * axis);
        const auto add = [&](int e, bool junction) {
            const Cell& below = cell_at(block, step(c, axis, -1));
            *out++ = {cell.first + static_cast<VertexId>(cell.sheet(e)),
                      below.first + static_cast<VertexId>(below.sheet(across(e, axis))), junction};
        };
        if (!parts.parted) {
            for (int k = 0; k < 4; ++k)
                if (label_cell::crossed(labels, edge(k))) {
                    add(edge(k), parts.junction);
                    break;
                }
            return out;
        }
        for (std::size_t k = 0; k < 2; ++k) {
            add(edge(parts.cut[k]), false);
            if (!(cell.necks >> axis & 1)) continue;
            const VertexId middle = cell.neck_vertex(axis) + static_cast<VertexId>(k), far = out[-1].b;
            out[-1].b = middle;
            *out++ = {middle, far, false};
        }
        return out;
    }

    /// An edge in the lower face across the axis, as the cell below numbers it.
    static int across(int edge, int axis) {
        return label_cell::edge_along(edge / 4, cell::lower_corner(edge) + (1 << axis));
    }

    /// The polygon around the grid edge from c along the axis.
    NetPolygon make_polygon(Block& block, const Samples& s, const Coord& c, int axis) const {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        // Around the edge: the cells at (u−1, v−1), (u, v−1), (u, v), (u−1, v), and the axis and the cell of
        // the face between each and the next.
        static constexpr int back_u[4] = {1, 0, 0, 1}, back_v[4] = {1, 1, 0, 0};
        NetPolygon out;
        out.below = s.at(c);
        out.above = s.at(step(c, axis, 1));
        std::array<VertexId, 4> sides;
        sides.fill(NetPolygon::none);
        bool necks = false;
        for (int k = 0; k < 4; ++k) {
            const Coord at = step(step(c, u, -back_u[k]), v, -back_v[k]);
            const int corner = back_u[k] << u | back_v[k] << v, e = label_cell::edge_along(axis, corner);
            const Cell& cell = cell_at(block, at);
            out.corner[static_cast<std::size_t>(k)] = cell.first + static_cast<VertexId>(cell.sheet(e));
            if (cell.many_labels) {
                const Labels labels = s.cell(at);
                const auto sheet = [&](float label) {
                    return label_cell::sheets_of_label(labels, label).of_edge[static_cast<std::size_t>(e)];
                };
                out.sheets_below |= static_cast<std::uint8_t>(sheet(out.below) << (2 * k));
                out.sheets_above |= static_cast<std::uint8_t>(sheet(out.above) << (2 * k));
            }
            // The lower faces of this cell that hold the edge: towards the next cell, and towards the last.
            if (!cell.necks) continue;
            for (const int a : {u, v}) {
                if ((a == u ? back_u : back_v)[k] || !(cell.necks >> a & 1)) continue;
                const int next = (k + 1) % 4;
                const bool to_next = (a == u ? back_u : back_v)[next] != 0;
                sides[static_cast<std::size_t>(to_next ? k : (k + 3) % 4)] =
                    cell.neck_vertex(a) + static_cast<VertexId>(neck_of_edge(s.cell(at), a, e));
                necks = true;
            }
        }
        if (necks) {
            out.extra = static_cast<std::int32_t>(block.side_vertices.size());
            block.side_vertices.push_back(sides);
        }
        return out;
    }

    /// Which of the two corners cut off in the lower face across the axis is an end of the edge.
    static int neck_of_edge(const Labels& labels, int axis, int edge) {
        const auto parts = label_cell::face_parts(labels, 2 * axis);
        const int corner = label_cell::face_corners(2 * axis)[static_cast<std::size_t>(parts.cut[1])];
        return corner == cell::lower_corner(edge) || corner == cell::upper_corner(edge) ? 1 : 0;
    }

    const openvdb::FloatTree& tree_;
    const CoordBBox box_;
    const float shift_;  // a little less than asked for: vertices of neighbouring cells never coincide
    const Progress progress_;
    std::set<float> labels_;
    std::vector<Coord> origins_;
    std::vector<Block> blocks_;
    std::unordered_map<Coord, const Block*> at_;
    LabelNet net_;
};

}  // namespace

LabelNet label_net(const DensityMap& map, double max_shift, const Progress& progress) {
    return Builder(map, max_shift, progress).run();
}

}  // namespace vdbgeo
