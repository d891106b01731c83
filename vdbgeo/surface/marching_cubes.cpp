#include "vdbgeo/surface/marching_cubes.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/cell_topology.h"
#include "vdbgeo/surface/crossing_blocks.h"

namespace vdbgeo {
namespace {

using cell::Pattern;
using openvdb::Coord;

constexpr int dim = leaf::dim;

/// Set bits of a byte: the baseline instruction set has no instruction for it.
struct BitCounts {
    std::array<std::uint8_t, 256> of{};
    constexpr BitCounts() {
        for (int i = 1; i < 256; ++i)
            of[static_cast<std::size_t>(i)] =
                static_cast<std::uint8_t>((i & 1) + of[static_cast<std::size_t>(i / 2)]);
    }
};
constexpr BitCounts bit_counts;
constexpr unsigned count_bits(unsigned byte) { return bit_counts.of[byte & 0xFF]; }

/// The crossed grid edges whose lower end lies in one block, in the order of their vertices: by row (x, y),
/// then axis, then z. Filled by the thread that counts the block.
struct BlockEdges {
    std::array<std::array<std::uint8_t, 3>, leaf::rows> crossed;  // bit z of [row][axis]
    std::array<std::uint16_t, leaf::rows> row_first;  // number of the row's first vertex in the block
    std::uint16_t edge_vertices, extra_vertices;
    std::uint32_t triangles;
    std::uint64_t first_vertex, first_triangle;
};

/// The vertex numbers on all crossed edges that a block's cells touch, its own and its upper neighbours'.
class VertexNumbers {
 public:
    /// Of the cell at (x, y, z): the vertex on its edge e is at [edge_place[e]].
    const VertexId* cell(int x, int y, int z) const { return number_.data() + place(x, y, z, 0); }

    static constexpr int place(int x, int y, int z, int axis) {
        return ((x * BlockSamples::dim + y) * 3 + axis) * BlockSamples::dim + z;
    }

    /// Takes the edges of the block (side 0) or of an upper neighbour that lie in the block's cells.
    void take(const BlockEdges& edges, int side) {
        const int x0 = side & 1 ? dim : 0, y0 = side & 2 ? dim : 0;
        const int nx = side & 1 ? 1 : dim, ny = side & 2 ? 1 : dim;
        for (int x = 0; x < nx; ++x)
            for (int y = 0; y < ny; ++y) {
                const auto row = static_cast<std::size_t>(leaf::row(x, y));
                auto next = static_cast<VertexId>(edges.first_vertex + edges.row_first[row]);
                for (int a = 0; a < 3; ++a) {
                    const unsigned crossed = edges.crossed[row][static_cast<std::size_t>(a)];
                    VertexId* out = number_.data() + place(x0 + x, y0 + y, 0, a);
                    if (side & 4) {
                        if (crossed & 1) out[dim] = next;
                        next += count_bits(crossed);
                    } else {
                        for (unsigned left = crossed; left; left &= left - 1)
                            out[__builtin_ctz(left)] = next++;
                    }
                }
            }
    }

 private:
    std::array<VertexId, 3 * BlockSamples::dim * BlockSamples::dim * BlockSamples::dim> number_{};
};

constexpr std::array<int, cell::edges> make_edge_places() {
    std::array<int, cell::edges> places{};
    for (int e = 0; e < cell::edges; ++e) {
        const int c = cell::lower_corner(e);
        places[static_cast<std::size_t>(e)] = VertexNumbers::place(c & 1, c >> 1 & 1, c >> 2 & 1, e / 4);
    }
    return places;
}
constexpr std::array<int, cell::edges> edge_place = make_edge_places();

/// Calls visit(x, y, z, sign case) for the block's cells that the surface crosses, in a fixed order.
template <class Visit>
void for_each_crossed_cell(const BlockSamples& s, const Vec3i& cells, const Visit& visit) {
    const unsigned in_box = (1u << cells.z()) - 1;
    for (std::size_t x = 0; x < static_cast<std::size_t>(cells.x()); ++x)
        for (std::size_t y = 0; y < static_cast<std::size_t>(cells.y()); ++y) {
            const unsigned a = s.inside[x][y], b = s.inside[x + 1][y], c = s.inside[x][y + 1],
                           d = s.inside[x + 1][y + 1];
            const unsigned any = a | b | c | d, all = a & b & c & d;
            for (unsigned left = (any | any >> 1) & ~(all & all >> 1) & in_box; left; left &= left - 1) {
                const int z = __builtin_ctz(left);
                const auto bits = [z](unsigned row) { return row >> z & 1; };
                const unsigned sign_case = bits(a) | bits(b) << 1 | bits(c) << 2 | bits(d) << 3 |
                                           bits(a >> 1) << 4 | bits(b >> 1) << 5 | bits(c >> 1) << 6 |
                                           bits(d >> 1) << 7;
                visit(static_cast<int>(x), static_cast<int>(y), z, static_cast<int>(sign_case));
            }
        }
}

/// The extraction of one map, in two passes over the crossed blocks: count, then fill.
class Extraction {
 public:
    Extraction(const DensityMap& map, float isovalue, const Progress& progress)
        : frame_(map.frame),
          mirrored_(map.frame.axes.determinant() < 0),
          isovalue_(isovalue),
          progress_(progress),
          blocks_(map.grid->constTree(), map.frame, isovalue, progress.part(0, 0.2)),
          hard_cells_((blocks_.size() + chunk - 1) / chunk) {}

    TriMesh run() {
        edges_.resize(blocks_.size());
        for_each_chunk(0.2, 0.5, [this](std::size_t b, Workspace& work) { count(b, work.samples); });
        const auto [vertices, triangles] = number();
        mesh_.points.resize(vertices);
        mesh_.triangles.resize(triangles);
        for_each_chunk(0.5, 1.0, [this](std::size_t b, Workspace& work) {
            place_vertices(b, work.samples);
            make_triangles(b, work);
        });
        return std::move(mesh_);
    }

 private:
    static constexpr std::size_t chunk = 32;  // blocks a task
    static constexpr double nearest = 1.0 / 1024;

    /// What a task keeps from block to block.
    struct Workspace {
        BlockSamples samples;
        VertexNumbers numbers;
        std::size_t hard = 0;  // hard cells of the chunk so far
    };

    template <class Body>
    void for_each_chunk(double from, double to, const Body& body) {
        const Progress progress = progress_.part(from, to);
        std::atomic<std::size_t> done{0};
        parallel_blocks(blocks_.size(), chunk, [&](std::size_t begin, std::size_t end) {
            Workspace work;
            for (std::size_t b = begin; b < end; ++b) {
                blocks_.load(b, work.samples);
                body(b, work);
            }
            const std::size_t now = done += end - begin;
            if ((now / chunk) % 64 == 0)
                progress.report(static_cast<double>(now) / static_cast<double>(blocks_.size()));
        });
        progress.report(1);
    }

    /// Samples of the block that lie in the box, along each axis (9: those of the next block too).
    Vec3i samples_in_box(std::size_t b) const {
        Vec3i n(dim + 1, dim + 1, dim + 1);
        if (frame_.bounded()) {
            const Coord origin = blocks_.origin(b);
            for (int a = 0; a < 3; ++a) n[a] = std::min(n[a], frame_.size[a] - origin[a]);
        }
        return n;
    }

    static Vec3i cells_in_box(const Vec3i& samples) { return samples - Vec3i::Ones(); }

    static std::array<double, 8> cell_values(const BlockSamples& s, int x, int y, int z, double isovalue) {
        std::array<double, 8> d;
        for (int c = 0; c < 8; ++c)
            d[static_cast<std::size_t>(c)] =
                s.values[x + (c & 1)][y + (c >> 1 & 1)][z + (c >> 2 & 1)] - isovalue;
        return d;
    }

    void count(std::size_t b, const BlockSamples& s) {
        BlockEdges& edges = edges_[b];
        const Vec3i n = samples_in_box(b);
        const unsigned samples = (1u << std::min(n.z(), dim)) - 1, steps = (1u << (n.z() - 1)) - 1;
        unsigned vertices = 0;
        for (int x = 0; x < dim; ++x)
            for (int y = 0; y < dim; ++y) {
                const auto row = static_cast<std::size_t>(leaf::row(x, y));
                edges.row_first[row] = static_cast<std::uint16_t>(vertices);
                edges.crossed[row] = {};
                if (x >= n.x() || y >= n.y()) continue;
                const auto at = [&](int i, int j) -> unsigned {
                    return s.inside[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
                };
                const unsigned here = at(x, y);
                const unsigned along[3] = {x + 1 < n.x() ? (here ^ at(x + 1, y)) & samples : 0,
                                           y + 1 < n.y() ? (here ^ at(x, y + 1)) & samples : 0,
                                           (here ^ here >> 1) & steps};
                for (std::size_t a = 0; a < 3; ++a) {
                    edges.crossed[row][a] = static_cast<std::uint8_t>(along[a]);
                    vertices += count_bits(along[a]);
                }
            }
        edges.edge_vertices = static_cast<std::uint16_t>(vertices);
        unsigned triangles = 0, extra = 0;
        for_each_crossed_cell(s, cells_in_box(n), [&](int x, int y, int z, int sign_case) {
            const Pattern* p = fixed_[static_cast<std::size_t>(sign_case)];
            if (!p) {
                p = &cell::pattern(sign_case, cell_values(s, x, y, z, isovalue_));
                hard_cells_[b / chunk].push_back(p);
            }
            triangles += p->triangle_count;
            extra += p->centre_count;
        });
        edges.triangles = triangles;
        edges.extra_vertices = static_cast<std::uint16_t>(extra);
    }

    std::pair<std::uint64_t, std::uint64_t> number() {
        std::uint64_t vertices = 0, triangles = 0;
        for (BlockEdges& e : edges_) {
            e.first_vertex = vertices;
            e.first_triangle = triangles;
            vertices += e.edge_vertices + e.extra_vertices;
            triangles += e.triangles;
        }
        if (vertices > TriMesh::max_vertices)
            throw InvalidInput(fmt::format(
                "the surface has {} vertices, more than 2^32-1: noise, or work for blocks", vertices));
        return {vertices, triangles};
    }

    Vec3f world(const Coord& origin, const Vec3d& place) const {
        return frame_.to_world(Vec3d(origin.x(), origin.y(), origin.z()) + place).cast<float>();
    }

    static Vec3d on_edge(int x, int y, int z, int axis, double t) {
        return {x + (axis == 0 ? t : 0), y + (axis == 1 ? t : 0), z + (axis == 2 ? t : 0)};
    }

    /// Where on the way from sample a to sample b the level set crosses.
    double crossing(float a, float b) const {
        const double low = a - isovalue_, high = b - isovalue_, t = low / (low - high);
        if (!(t >= 0 && t <= 1)) return 0.5;  // a sample is not a finite number
        return std::min(1 - nearest, std::max(nearest, t));
    }

    void place_vertices(std::size_t b, const BlockSamples& s) {
        const BlockEdges& edges = edges_[b];
        const Coord origin = blocks_.origin(b);
        Vec3f* out = mesh_.points.data() + edges.first_vertex;
        for (int x = 0; x < dim; ++x)
            for (int y = 0; y < dim; ++y)
                for (int a = 0; a < 3; ++a) {
                    const auto row = static_cast<std::size_t>(leaf::row(x, y));
                    for (unsigned left = edges.crossed[row][static_cast<std::size_t>(a)]; left;
                         left &= left - 1) {
                        const int z = __builtin_ctz(left);
                        const float from = s.values[x][y][z],
                                    to = s.values[x + (a == 0)][y + (a == 1)][z + (a == 2)];
                        *out++ = world(origin, on_edge(x, y, z, a, crossing(from, to)));
                    }
                }
    }

    Vec3d crossing_on(const BlockSamples& s, int x, int y, int z, int e) const {
        const int c = cell::lower_corner(e), d = cell::upper_corner(e);
        const auto value = [&](int k) { return s.values[x + (k & 1)][y + (k >> 1 & 1)][z + (k >> 2 & 1)]; };
        return on_edge(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2 & 1), e / 4, crossing(value(c), value(d)));
    }

    Vec3d mean_crossing(const BlockSamples& s, int x, int y, int z, unsigned edges) const {
        Vec3d sum = Vec3d::Zero();
        for (unsigned left = edges; left; left &= left - 1)
            sum += crossing_on(s, x, y, z, __builtin_ctz(left));
        return sum / __builtin_popcount(edges);
    }

    void make_triangles(std::size_t b, Workspace& work) {
        for (int side = 0; side < 8; ++side) {
            const std::int64_t n = blocks_.neighbour(b, side);
            if (n >= 0) work.numbers.take(edges_[static_cast<std::size_t>(n)], side);
        }
        const BlockEdges& edges = edges_[b];
        const BlockSamples& s = work.samples;
        Triangle* out = mesh_.triangles.data() + edges.first_triangle;
        std::uint64_t extra = edges.first_vertex + edges.edge_vertices;
        std::array<VertexId, cell::edges + cell::max_centres> id;
        for_each_crossed_cell(s, cells_in_box(samples_in_box(b)), [&](int x, int y, int z, int sign_case) {
            const Pattern* fixed = fixed_[static_cast<std::size_t>(sign_case)];
            const Pattern& p = fixed ? *fixed : *hard_cells_[b / chunk][work.hard++];
            const VertexId* number = work.numbers.cell(x, y, z);
            for (std::size_t e = 0; e < cell::edges; ++e) id[e] = number[edge_place[e]];
            for (std::size_t k = 0; k < p.centre_count; ++k) {
                const Vec3d place = 0.5 * (mean_crossing(s, x, y, z, p.centre_edges[k]) +
                                           mean_crossing(s, x, y, z, p.around_edges[k]));
                mesh_.points[extra] = world(blocks_.origin(b), place);
                id[cell::edges + k] = static_cast<VertexId>(extra++);
            }
            for (std::size_t k = 0; k < p.triangle_count; ++k, ++out)
                for (std::size_t v = 0; v < 3; ++v) (*out)[mirrored_ ? 2 - v : v] = id[p.triangles[k][v]];
        });
    }

    const Frame frame_;
    const bool mirrored_;  // the frame turns triangles round
    const double isovalue_;
    const Progress progress_;
    const CrossingBlocks blocks_;
    const std::array<const Pattern*, 256>& fixed_ = cell::fixed_patterns();
    Array<BlockEdges> edges_;
    std::vector<std::vector<const Pattern*>> hard_cells_;  // per chunk, in cell order
    TriMesh mesh_;
};

}  // namespace

void MarchingCubesOptions::check() const {
    if (!std::isfinite(static_cast<float>(isovalue)))
        throw InvalidInput("the isovalue is not a finite number");
}

TriMesh marching_cubes(const DensityMap& map, const MarchingCubesOptions& options, const Progress& progress) {
    options.check();
    if (map.frame.bounded() && map.frame.size.minCoeff() < 2) return {};  // no cells
    return Extraction(map, static_cast<float>(options.isovalue), progress).run();
}

}  // namespace vdbgeo
