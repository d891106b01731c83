// The inner loops of marching cubes, over the cells of one block; one set for each kind of CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vdbgeo::cell {

constexpr int block_dim = 8;  // cells along an edge of a block; its samples have one more
constexpr int block_cells = 512;
constexpr int sample_stride = 12;  // floats from row to row of a block's samples

/// Bit 8·y + z of word x, as in LeafSigns: one bit for each cell, or for each sample, of a block.
using BlockBits = std::uint64_t[block_dim];

/// For each ambiguous face of a block's cells whether its inside corners are joined; 0 for other faces.
/// `lower[a]`: of the cells' lower faces across axis a, `upper[a]`: of the upper ones.
struct FaceBits {
    BlockBits lower[3], upper[3];
};

/// The crossed edges of a block's samples and their vertices' numbers. Those go by row (x, y), then z, then
/// axis.
struct EdgeBits {
    BlockBits crossed[3];
    BlockBits row_first;  ///< byte y of word x: the first vertex of row (x, y), from the first of the layer x
    std::uint16_t layer_first[block_dim + 1];  ///< the first vertex of layer x, from the first of the block
};

/// A vertex number for each sample and axis, of the edges that begin there; uncrossed ones have any number.
struct VertexNumbers {
    static constexpr int dim = block_dim + 1;
    alignas(64) std::uint32_t of[dim][dim][12][4];  // 9 of 12 samples of a row, 3 of 4 axes
};

/// The vertices around a cell: number of edge (axis a, lower corner c) is at 16 (c & 1) + 8 (c >> 1 & 1) +
/// 4 (c >> 2) + a. Places with a = 3 are free.
constexpr int cell_numbers = 32;
constexpr int number_place(int axis, int corner) {
    return 16 * (corner & 1) + 8 * (corner >> 1 & 1) + 4 * (corner >> 2) + axis;
}

/// How the patterns are drawn: for each pattern the places (number_place) of its triangles' corners.
struct Drawing {
    struct Places {
        alignas(16) std::uint8_t place[16];
    };
    const Places *first, *more;  ///< the corners 0…15, and 16…31
    /// Corners, three for a triangle; with `special` added where the pattern has vertices inside the cell or
    /// more than 32 corners.
    const std::uint8_t* corners;
    static constexpr int special = 128;
};

/// What a block's cells are drawn with. Writes may reach further than what is drawn, but not to `end`.
struct DrawingTask {
    const std::uint64_t* active;   ///< the cells
    const std::uint16_t* pattern;  ///< of each active cell
    const VertexNumbers* numbers;
    Drawing drawing;
    std::uint32_t *out, *end;
    /// Draws a cell whose pattern is special; `numbers` are those around it, with the free places to fill.
    void (*draw_special)(void* context, int x, int y, int z, int pattern, std::uint32_t* numbers,
                         std::uint32_t* out);
    void* context;
};

/// Where vertices lie in a frame whose axes are those of the world: origin + step · (index + place in the
/// block).
struct DiagonalPlacing {
    double origin[3], step[3], index[3];
    double isovalue;
    double nearest;    ///< to the ends of an edge
    const float* end;  ///< writes may reach one float further than the vertices, but not to here
};

/// A cell whose pattern its corner values are to settle.
struct OpenCell {
    std::uint16_t cell;  ///< 64·x + 8·y + z
    std::uint16_t item;  ///< its place among the block's active cells
};

/// Whether the arcs of a cell's slices z = t change while the slice's corners (0, 0) and (1, 1), or the other
/// two, alone are inside.
struct SliceTest {
    OpenCell open;
    std::uint8_t diagonal;  ///< 0, 1
    bool change;            ///< the answer
};

constexpr int tests_at_once = 8;

struct Counts {
    int cells, open;
};

struct Kernels {
    const char* name;
    /// Bit 8·y + z of word x: values[64·x + 8·y + z] ≥ isovalue.
    void (*sign_words)(const float* values, float isovalue, BlockBits words);
    /// The active cells' patterns by their keys: `of_key` is a PatternTable's, corner c's signs are in
    /// corners[c]. Those with the highest bit set are listed. Returns how many cells there are, and of the
    /// list.
    Counts (*list_patterns)(const BlockBits active, const std::uint64_t* const corners[8],
                            const FaceBits* faces, const std::uint16_t* of_key, std::uint16_t* patterns,
                            OpenCell* open);
    /// Settles the tests. The sign changes along z bound an interval of t; in it the arcs change at a zero of
    /// a quadratic. Exact, in place of the case-by-case tests of Chernyaev (1995). `count` is a multiple of
    /// `tests_at_once`.
    void (*settle)(const float* samples, float isovalue, SliceTest* tests, int count);
    /// Takes the vertices of the block (side 0) or of an upper neighbour (bit a: along axis a) that lie on
    /// the block's cells.
    void (*take_numbers)(const EdgeBits& edges, std::uint32_t first_vertex, int side, VertexNumbers& numbers);
    /// The vertices on a block's edges.
    void (*place_vertices)(const float* samples, const EdgeBits& edges, const DiagonalPlacing& placing,
                           float* out);
    void (*draw)(const DrawingTask& task);
};

/// The kernel sets this CPU can run, the plainest first. All give the same bits.
const std::vector<const Kernels*>& available_kernels();

/// The fastest of them, or the one that the environment variable VDBGEO_CPU names (baseline, avx2, avx512).
const Kernels& kernels();

}  // namespace vdbgeo::cell
