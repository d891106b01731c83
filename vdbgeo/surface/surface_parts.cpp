#include "vdbgeo/surface/surface_parts.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <tuple>
#include <unordered_map>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/block_cells.h"
#include "vdbgeo/surface/block_surface.h"
#include "vdbgeo/surface/crossing_blocks.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

constexpr int node_voxels = leaf::LowerNode::DIM;
constexpr int sides = 7;  // no cell has an edge of the block above along all axes

Coord column_origin(const Coord& block) { return {block.x(), block.y(), block.z() & ~(node_voxels - 1)}; }

/// The order of columns in the mesh.
bool before(const Coord& a, const Coord& b) {
    const auto key = [](const Coord& c) {
        return std::tuple(c.x() & ~(node_voxels - 1), c.y() & ~(node_voxels - 1), c.z(), c.x(), c.y());
    };
    return key(a) < key(b);
}

Coord step(const Coord& block, int side, int voxels) {
    return block.offsetBy(side & 1 ? voxels : 0, side & 2 ? voxels : 0, side & 4 ? voxels : 0);
}

/// Whether cells of the block that lies below along the axes of `side` share crossed edges with this one.
bool shares_edges(const cell::EdgeBits& edges, int side) {
    const std::uint64_t layer = (side & 2 ? 0xFFull : ~0ull) & (side & 4 ? 0x0101010101010101ull : ~0ull);
    for (int x = 0; x < (side & 1 ? 1 : leaf::dim); ++x)
        if ((edges.crossed[0][x] | edges.crossed[1][x] | edges.crossed[2][x]) & layer) return true;
    return false;
}

/// Has the pages of an array that is about to be written put there by one call, which costs less than a fault
/// for each. Nothing depends on it.
void fault_in(const void* begin, const void* end) {
#ifdef MADV_POPULATE_WRITE
    static const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
    const auto first = reinterpret_cast<std::uintptr_t>(begin) & ~(page - 1),
               last = reinterpret_cast<std::uintptr_t>(end) & ~(page - 1);
    if (first < last) madvise(reinterpret_cast<void*>(first), last - first, MADV_POPULATE_WRITE);
#endif
}

void add_run(std::vector<SurfaceRun>& runs, std::uint64_t first, std::uint64_t count) {
    if (count == 0) return;
    if (!runs.empty() && runs.back().first + runs.back().count == first)
        runs.back().count += count;
    else
        runs.push_back({first, count});
}

}  // namespace

SurfaceNumbers::SurfaceNumbers(std::vector<SurfaceColumn> columns) {
    const auto by_place = [](const SurfaceColumn& a, const SurfaceColumn& b) {
        return before(a.origin, b.origin);
    };
    if (!std::is_sorted(columns.begin(), columns.end(), by_place))
        std::sort(columns.begin(), columns.end(), by_place);
    columns_.reserve(columns.size());
    for (const SurfaceColumn& c : columns) {
        columns_.push_back({c.origin, static_cast<std::uint32_t>(vertices_), triangles_});
        vertices_ += c.vertices;
        triangles_ += c.triangles;
    }
    if (vertices_ > TriMesh::max_vertices)
        throw InvalidInput(fmt::format(
            "the surface has {} vertices, more than 2^32-1: noise, or work for blocks", vertices_));
}

const SurfaceNumbers::Column& SurfaceNumbers::column_of(const Coord& block) const {
    const Coord origin = column_origin(block);
    return *std::lower_bound(columns_.begin(), columns_.end(), origin,
                             [](const Column& c, const Coord& at) { return before(c.origin, at); });
}

Coord BorderBlock::block_below(int side) const { return step(origin, side, -leaf::dim); }

/// The extraction of one part, which may be all of a map.
class SurfacePart::Extraction {
 public:
    Extraction(const DensityMap& part, float isovalue, const CoordBBox& own, const Progress& progress)
        : own_(own),
          blocks_(part.grid->constTree(), part.frame, isovalue, progress.part(0, 0.4),
                  has_cells(part.frame) ? own : CoordBBox()),
          surface_(blocks_, part.frame, isovalue),
          patterns_((blocks_.size() + chunk - 1) / chunk) {
        cells_.resize(blocks_.size() + 1);
        for_each_chunk(0, blocks_.size(), progress.part(0.4, 1),
                       [this](std::size_t begin, std::size_t end) { count(begin, end); });
        place();
    }

    std::vector<SurfaceColumn> columns() const;
    std::vector<BorderBlock> border() const;
    void number(const SurfaceNumbers& numbers, const std::vector<BorderBlock>& above);
    SurfacePiece fill(std::size_t begin, std::size_t end, const Progress& progress) const;
    std::size_t size() const { return blocks_.size(); }
    std::size_t end_of_piece(std::size_t begin, std::size_t bytes) const;

 private:
    static constexpr std::size_t chunk = 32;  // blocks a task

    struct Column {
        SurfaceColumn counted;
        std::size_t first_block = 0, end_block = 0;
        std::uint64_t first_triangle = 0;  // in the mesh
    };
    struct BlockAbove {
        cell::EdgeBits edges;
        std::uint32_t first_vertex;
    };

    static bool has_cells(const Frame& frame) { return !frame.bounded() || frame.size.minCoeff() >= 2; }

    template <class Body>
    static void for_each_chunk(std::size_t first, std::size_t last, const Progress& progress,
                               const Body& body) {
        std::atomic<std::size_t> done{0};
        parallel_blocks(last - first, chunk, [&](std::size_t begin, std::size_t end) {
            body(first + begin, first + end);
            const std::size_t now = done += end - begin;
            if ((now / chunk) % 64 == 0)
                progress.report(static_cast<double>(now) / static_cast<double>(last - first));
        });
        progress.report(1);
    }

    void count(std::size_t begin, std::size_t end);
    void place();
    void fill_blocks(std::size_t begin, std::size_t end, SurfacePiece& out, const BlockCells& first,
                     const BlockCells& behind) const;
    void take_numbers(BlockSurface::Filling& filling) const;
    void list_runs(std::size_t begin, std::size_t end, SurfacePiece& out) const;

    const CoordBBox own_;
    const CrossingBlocks blocks_;
    const BlockSurface surface_;
    Array<BlockCells> cells_;  // of the blocks; one more has the places behind the last
    std::vector<std::vector<cell::PatternId>> patterns_;  // of the active cells, per chunk
    std::vector<Column> columns_;
    std::unordered_map<Coord, BlockAbove> above_;  // of other parts
};

void SurfacePart::Extraction::count(std::size_t begin, std::size_t end) {
    BlockSamples samples;
    std::array<cell::PatternId, chunk * cell::block_cells> patterns;
    cell::PatternId* next = patterns.data();
    for (std::size_t b = begin; b < end; ++b) next = surface_.count(b, samples, cells_[b], next);
    patterns_[begin / chunk].assign(patterns.data(), next);
}

/// Where the blocks' vertices and triangles stand in this part, which are their numbers if it is all. Places
/// of 2^32 and more are wrong; nobody can number such a part.
void SurfacePart::Extraction::place() {
    std::uint32_t vertices = 0;
    std::uint64_t triangles = 0;
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        const Coord origin = column_origin(blocks_.origin(b));
        if (columns_.empty() || columns_.back().counted.origin != origin)
            columns_.push_back({{origin, 0, 0}, b, b, triangles});
        columns_.back().end_block = b + 1;
        BlockCells& c = cells_[b];
        c.first_vertex = c.vertex_place = vertices;
        c.triangle_place = triangles;
        const std::uint32_t in_block = std::uint32_t{c.edge_vertices} + c.extra_vertices;
        columns_.back().counted.vertices += in_block;
        columns_.back().counted.triangles += c.triangles;
        vertices += in_block;
        triangles += c.triangles;
    }
    cells_.back().vertex_place = vertices;
    cells_.back().triangle_place = triangles;
}

std::vector<SurfaceColumn> SurfacePart::Extraction::columns() const {
    std::vector<SurfaceColumn> out;
    for (const Column& c : columns_)
        if (c.counted.vertices > 0 || c.counted.triangles > 0) out.push_back(c.counted);
    return out;
}

std::vector<BorderBlock> SurfacePart::Extraction::border() const {
    std::vector<BorderBlock> out;
    for (const Column& column : columns_)
        for (std::size_t b = column.first_block; b < column.end_block; ++b) {
            BorderBlock block;
            block.origin = blocks_.origin(b);
            for (int side = 1; side < sides; ++side)
                if (!own_.isInside(block.block_below(side)) && shares_edges(cells_[b].edges, side))
                    block.below |= 1u << side;
            if (!block.below) continue;
            block.vertex_in_column = cells_[b].vertex_place - cells_[column.first_block].vertex_place;
            block.edges = cells_[b].edges;
            out.push_back(block);
        }
    return out;
}

void SurfacePart::Extraction::number(const SurfaceNumbers& numbers, const std::vector<BorderBlock>& above) {
    for (Column& column : columns_) {
        if (column.counted.vertices == 0 && column.counted.triangles == 0) continue;
        const SurfaceNumbers::Column& place = numbers.column_of(column.counted.origin);
        column.first_triangle = place.first_triangle;
        const std::uint32_t shift = place.first_vertex - cells_[column.first_block].vertex_place;
        if (cells_[column.first_block].first_vertex == place.first_vertex) continue;
        for (std::size_t b = column.first_block; b < column.end_block; ++b)
            cells_[b].first_vertex = cells_[b].vertex_place + shift;
    }
    above_.clear();
    for (const BorderBlock& block : above) {
        const auto is_mine = [&](int side) {
            return (block.below >> side & 1) && own_.isInside(block.block_below(side));
        };
        bool mine = false;
        for (int side = 1; side < sides; ++side) mine |= is_mine(side);
        if (!mine || own_.isInside(block.origin)) continue;
        const std::uint32_t first = numbers.column_of(block.origin).first_vertex;
        above_[block.origin] = {block.edges, first + block.vertex_in_column};
    }
}

/// The vertices around the block's cells: its own and those of its upper neighbours.
void SurfacePart::Extraction::take_numbers(BlockSurface::Filling& filling) const {
    for (int side = 0; side < sides; ++side) {
        const std::int64_t n = blocks_.neighbour(filling.block, side);
        if (n >= 0) {
            const BlockCells& from = cells_[static_cast<std::size_t>(n)];
            surface_.take_numbers(from.edges, from.first_vertex, side, filling);
        } else if (!above_.empty()) {
            const auto from = above_.find(step(blocks_.origin(filling.block), side, leaf::dim));
            if (from != above_.end())
                surface_.take_numbers(from->second.edges, from->second.first_vertex, side, filling);
        }
    }
}

/// `first` and `behind`: the blocks that the piece begins and ends at.
void SurfacePart::Extraction::fill_blocks(std::size_t begin, std::size_t end, SurfacePiece& out,
                                          const BlockCells& first, const BlockCells& behind) const {
    BlockSurface::Filling filling;
    const auto point = [&](const BlockCells& c) {
        return out.points.data() + (c.vertex_place - first.vertex_place);
    };
    const auto triangle = [&](const BlockCells& c) {
        return out.triangles.data() + (c.triangle_place - first.triangle_place);
    };
    // What follows is another task's. (Either array may be empty, and its address null.)
    filling.end_of_points = reinterpret_cast<const float*>(point(cells_[end]));
    filling.end_of_triangles = reinterpret_cast<VertexId*>(triangle(cells_[end]));
    // Smaller arrays may come from memory that the process has used before.
    constexpr std::size_t large = std::size_t{32} << 20;
    if ((behind.vertex_place - first.vertex_place) * sizeof(Vec3f) >= large)
        fault_in(point(cells_[begin]), filling.end_of_points);
    if ((behind.triangle_place - first.triangle_place) * sizeof(Triangle) >= large)
        fault_in(triangle(cells_[begin]), filling.end_of_triangles);
    const cell::PatternId* patterns = patterns_[begin / chunk].data();
    for (std::size_t b = begin; b < end; ++b) {
        const BlockCells& cells = cells_[b];
        filling.block = b;
        filling.points = point(cells);
        filling.triangles = triangle(cells);
        surface_.load(filling);
        if (cells.edge_vertices > 0) surface_.place_vertices(filling, cells);
        if (cells.cells == 0) continue;
        take_numbers(filling);
        surface_.make_triangles(filling, cells, patterns);
        patterns += cells.cells;
    }
}

/// The runs of the vertices and triangles of some blocks.
void SurfacePart::Extraction::list_runs(std::size_t begin, std::size_t end, SurfacePiece& out) const {
    auto column = std::upper_bound(columns_.begin(), columns_.end(), begin,
                                   [](std::size_t b, const Column& c) { return b < c.first_block; }) -
                  1;
    for (std::size_t b = begin; b < end; ++column) {
        const std::size_t last = std::min(end, column->end_block);
        const BlockCells &from = cells_[b], &to = cells_[last];
        add_run(out.point_runs, from.first_vertex, to.vertex_place - from.vertex_place);
        add_run(out.triangle_runs,
                column->first_triangle + (from.triangle_place - cells_[column->first_block].triangle_place),
                to.triangle_place - from.triangle_place);
        b = last;
    }
}

/// `begin` is the first block of a chunk.
SurfacePiece SurfacePart::Extraction::fill(std::size_t begin, std::size_t end,
                                           const Progress& progress) const {
    SurfacePiece out;
    if (begin < end) {
        const BlockCells &first = cells_[begin], &behind = cells_[end];
        out.points.resize(behind.vertex_place - first.vertex_place);
        out.triangles.resize(behind.triangle_place - first.triangle_place);
        list_runs(begin, end, out);
        for_each_chunk(begin, end, progress,
                       [&](std::size_t b, std::size_t e) { fill_blocks(b, e, out, first, behind); });
    }
    progress.report(1);
    return out;
}

/// The block, at the begin of a chunk or the end of all, up to which a mesh of so many bytes goes.
std::size_t SurfacePart::Extraction::end_of_piece(std::size_t begin, std::size_t bytes) const {
    std::size_t end = begin;
    const auto size_up_to = [&](std::size_t b) {
        return (cells_[b].vertex_place - cells_[begin].vertex_place) * sizeof(Vec3f) +
               (cells_[b].triangle_place - cells_[begin].triangle_place) * sizeof(Triangle);
    };
    do end = std::min(end + chunk, size());
    while (end < size() && size_up_to(end) < bytes);
    return end;
}

SurfacePart::SurfacePart(const DensityMap& part, float isovalue, const CoordBBox& own,
                         const Progress& progress)
    : extraction_(std::make_unique<Extraction>(part, isovalue, own, progress)) {}
SurfacePart::SurfacePart(SurfacePart&&) noexcept = default;
SurfacePart& SurfacePart::operator=(SurfacePart&&) noexcept = default;
SurfacePart::~SurfacePart() = default;

std::vector<SurfaceColumn> SurfacePart::columns() const { return extraction_->columns(); }
std::vector<BorderBlock> SurfacePart::border() const { return extraction_->border(); }

void SurfacePart::number(const SurfaceNumbers& numbers, const std::vector<BorderBlock>& above) {
    extraction_->number(numbers, above);
}

SurfacePiece SurfacePart::fill(const Progress& progress) const {
    return extraction_->fill(0, extraction_->size(), progress);
}

void SurfacePart::fill(std::size_t bytes, const std::function<void(const SurfacePiece&)>& take,
                       const Progress& progress) const {
    const std::size_t size = extraction_->size();
    const auto share = [&](std::size_t b) { return static_cast<double>(b) / static_cast<double>(size); };
    for (std::size_t begin = 0, end = 0; begin < size; begin = end) {
        end = extraction_->end_of_piece(begin, bytes);
        take(extraction_->fill(begin, end, progress.part(share(begin), share(end))));
    }
    progress.report(1);
}

}  // namespace vdbgeo
