#include "vdbgeo/surface/block_surface.h"

#include <cmath>

#include "vdbgeo/surface/cell_tunnel.h"

namespace vdbgeo {

using cell::Pattern;
using openvdb::Coord;

/// The pattern table in the form that the kernels draw from.
class DrawingTable {
 public:
    explicit DrawingTable(bool mirrored) {
        const std::vector<Pattern>& patterns = cell::pattern_table().patterns;
        first_.resize(patterns.size());
        more_.resize(patterns.size());
        for (std::size_t p = 0; p < patterns.size(); ++p) {
            const Pattern& pattern = patterns[p];
            const int count = 3 * pattern.triangle_count;
            const bool special = pattern.centre_count > 0 || pattern.has_tunnel() || count > 32;
            corners_.push_back(static_cast<std::uint8_t>(special ? count + cell::Drawing::special : count));
            sizes_.push_back(pattern.triangle_count | static_cast<std::uint32_t>(pattern.centre_count) << 16);
            if (special) continue;
            for (int i = 0; i < count; ++i) {
                const int v = mirrored ? 2 - i % 3 : i % 3;
                const int place =
                    place_of(pattern.triangles[static_cast<std::size_t>(i / 3)][static_cast<std::size_t>(v)]);
                (i < 16 ? first_ : more_)[p].place[i & 15] = static_cast<std::uint8_t>(place);
            }
        }
    }

    /// Where the number of a pattern's vertex stands: those inside the cell take the free places.
    static int place_of(int vertex) {
        if (vertex >= cell::edges) return cell::number_place(3, vertex - cell::edges);
        return cell::number_place(vertex / 4, cell::lower_corner(vertex));
    }

    cell::Drawing drawing() const { return {first_.data(), more_.data(), corners_.data()}; }
    /// Triangles of a pattern | vertices inside the cell << 16.
    std::uint32_t size(cell::PatternId p) const { return sizes_[p]; }

 private:
    std::vector<cell::Drawing::Places> first_, more_;
    std::vector<std::uint8_t> corners_;
    std::vector<std::uint32_t> sizes_;
};

namespace {

constexpr int dim = leaf::dim;
constexpr double nearest = 1.0 / 1024;

const DrawingTable& drawing_table(bool mirrored) {
    static const DrawingTable direct(false), reversed(true);
    return mirrored ? reversed : direct;
}

Vec3d on_edge(int x, int y, int z, int axis, double t) {
    return {x + (axis == 0 ? t : 0), y + (axis == 1 ? t : 0), z + (axis == 2 ? t : 0)};
}

}  // namespace

BlockSurface::BlockSurface(const CrossingBlocks& blocks, const Frame& frame, float isovalue)
    : blocks_(blocks),
      frame_(frame),
      mirrored_(frame.axes.determinant() < 0),
      diagonal_(frame.axes.isDiagonal(0)),
      isovalue_(isovalue),
      table_(drawing_table(mirrored_)) {}

/// Samples of the block that lie in the box, along each axis (9: those of the next block too).
Vec3i BlockSurface::samples_in_box(std::size_t b) const {
    Vec3i n(dim + 1, dim + 1, dim + 1);
    if (frame_.bounded()) {
        const Coord origin = blocks_.origin(b);
        for (int a = 0; a < 3; ++a) n[a] = std::min(n[a], frame_.size[a] - origin[a]);
    }
    return n;
}

cell::PatternId* BlockSurface::count(std::size_t b, BlockSamples& samples, BlockCells& out,
                                     cell::PatternId* patterns) const {
    CornerSigns signs;
    blocks_.load_signs(b, signs);
    find_edges(signs, samples_in_box(b), out);
    cell::FaceBits faces;
    const bool ambiguous = find_ambiguous_faces(signs, out.active, faces);
    if (ambiguous) {
        blocks_.load(b, samples);
        decide_faces(signs, samples, isovalue_, faces);
    }
    const std::uint64_t* const corners[8] = {signs.here, signs.here + 1, signs.y,  signs.y + 1,
                                             signs.z,    signs.z + 1,    signs.yz, signs.yz + 1};
    std::array<cell::OpenCell, cell::block_cells> open;
    const auto [count, open_count] =
        kernels_.list_patterns(out.active, corners, ambiguous ? &faces : nullptr,
                               cell::pattern_table().of_key.data(), patterns, open.data());
    if (open_count > 0) {
        if (!ambiguous) blocks_.load(b, samples);
        settle(open.data(), open_count, samples, patterns);
    }
    std::uint32_t sizes = 0;
    for (int i = 0; i < count; ++i) sizes += table_.size(patterns[i]);
    out.triangles = sizes & 0xFFFF;
    out.extra_vertices = static_cast<std::uint16_t>(sizes >> 16);
    out.cells = static_cast<std::uint16_t>(count);
    return patterns + count;
}

/// Finds which of the cells have tunnels.
void BlockSurface::settle(const cell::OpenCell* open, int count, const BlockSamples& samples,
                          cell::PatternId* patterns) const {
    std::array<cell::SliceTest, 2 * cell::block_cells + cell::tests_at_once> tests;
    const auto tunnels = [&](const cell::OpenCell& c) -> const cell::TunnelPatterns& {
        return cell::pattern_table().tunnels[patterns[c.item] & ~cell::unsettled];
    };
    std::size_t n = 0;
    for (int i = 0; i < count; ++i)
        for (std::uint8_t diagonal = 0; diagonal < 2; ++diagonal) {
            tests[n] = {open[i], diagonal, false};
            n += tunnels(open[i])[diagonal] != cell::no_pattern;
        }
    std::size_t full = n;
    while (full % cell::tests_at_once) tests[full++] = tests[n - 1];
    kernels_.settle(samples.values[0][0], static_cast<float>(isovalue_), tests.data(),
                    static_cast<int>(full));
    for (std::size_t i = 0; i < n; ++i) {
        cell::PatternId& pattern = patterns[tests[i].open.item];
        if (tests[i].change && (pattern & cell::unsettled))
            pattern = tunnels(tests[i].open)[tests[i].diagonal];
    }
    for (int i = 0; i < count; ++i) patterns[open[i].item] &= static_cast<cell::PatternId>(~cell::unsettled);
}

Vec3f BlockSurface::world(const Coord& origin, const Vec3d& place) const {
    return frame_.to_world(Vec3d(origin.x(), origin.y(), origin.z()) + place).cast<float>();
}

/// Where on the way from sample a to sample b the level set crosses.
double BlockSurface::crossing(float a, float b) const {
    const double low = a - isovalue_, high = b - isovalue_, t = low / (low - high);
    if (!(t >= 0 && t <= 1)) return 0.5;  // a sample is not a finite number
    return std::min(1 - nearest, std::max(nearest, t));
}

void BlockSurface::place_vertices(Filling& filling, const BlockCells& cells) const {
    const Coord origin = blocks_.origin(filling.block);
    Vec3f* out = filling.points;
    if (diagonal_) {
        cell::DiagonalPlacing placing;
        for (int a = 0; a < 3; ++a) {
            placing.origin[a] = frame_.origin[a];
            placing.step[a] = frame_.axes(a, a);
            placing.index[a] = origin[a];
        }
        placing.isovalue = isovalue_;
        placing.nearest = nearest;
        placing.end = filling.end_of_points;
        kernels_.place_vertices(filling.samples.values[0][0], cells.edges, placing, out->data());
        return;
    }
    const BlockSamples& s = filling.samples;
    for (int x = 0; x < dim; ++x)
        for (int i = 0; i < dim * dim; ++i)
            for (int a = 0; a < 3; ++a) {
                if (!(cells.edges.crossed[a][x] >> i & 1)) continue;
                const int y = i >> 3, z = i & 7;
                const float from = s.values[x][y][z], to = s.values[x + (a == 0)][y + (a == 1)][z + (a == 2)];
                *out++ = world(origin, on_edge(x, y, z, a, crossing(from, to)));
            }
}

Vec3d BlockSurface::crossing_on(const BlockSamples& s, int x, int y, int z, int e) const {
    const int c = cell::lower_corner(e), d = cell::upper_corner(e);
    const auto value = [&](int k) { return s.values[x + (k & 1)][y + (k >> 1 & 1)][z + (k >> 2 & 1)]; };
    return on_edge(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2 & 1), e / 4, crossing(value(c), value(d)));
}

/// A cell with vertices inside or a tunnel.
void BlockSurface::draw_special(Filling& filling, int x, int y, int z, int pattern, VertexId* numbers,
                                VertexId* out) const {
    Pattern p = cell::pattern_table().patterns[static_cast<std::size_t>(pattern)];
    std::array<Vec3d, cell::edges> crossings;  // from the cell's lowest corner
    const auto take_crossing = [&](int e) {
        crossings[static_cast<std::size_t>(e)] = crossing_on(filling.samples, x, y, z, e) - Vec3d(x, y, z);
    };
    std::array<Vec3d, cell::max_centres> centres;
    for (std::size_t k = 0; k < p.centre_count; ++k) {
        if (!p.centre_edges[k]) continue;
        Vec3d sum = Vec3d::Zero();
        int count = 0;
        for (unsigned left = p.centre_edges[k]; left; left &= left - 1, ++count) {
            const int e = __builtin_ctz(left);
            take_crossing(e);
            sum += crossings[static_cast<std::size_t>(e)];
        }
        centres[k] = sum / count;
    }
    if (p.has_tunnel()) {
        for (std::size_t l = 0; l < 2; ++l)
            for (std::size_t i = 0; i < p.tunnel.size[l]; ++i) take_crossing(p.tunnel.loop[l][i]);
        cell::make_tunnel(p, crossings, centres);
    }
    for (std::size_t k = 0; k < p.centre_count; ++k) {
        *filling.extra_point++ = world(blocks_.origin(filling.block), Vec3d(x, y, z) + centres[k]);
        numbers[DrawingTable::place_of(cell::edges + static_cast<int>(k))] = filling.extra_number++;
    }
    for (std::size_t k = 0; k < p.triangle_count; ++k)
        for (std::size_t v = 0; v < 3; ++v)
            *out++ = numbers[DrawingTable::place_of(p.triangles[k][mirrored_ ? 2 - v : v])];
}

void BlockSurface::make_triangles(Filling& filling, const BlockCells& cells,
                                  const cell::PatternId* patterns) const {
    filling.extra_point = filling.points + cells.edge_vertices;
    filling.extra_number = cells.first_vertex + cells.edge_vertices;
    struct Context {
        const BlockSurface* surface;
        Filling* filling;
    } context{this, &filling};
    kernels_.draw({cells.active, patterns, &filling.numbers, table_.drawing(), filling.triangles->data(),
                   filling.end_of_triangles,
                   [](void* c, int x, int y, int z, int pattern, std::uint32_t* numbers, std::uint32_t* out) {
                       const auto& [surface, f] = *static_cast<Context*>(c);
                       surface->draw_special(*f, x, y, z, pattern, numbers, out);
                   },
                   &context});
}

}  // namespace vdbgeo
