#include "vdbgeo/surface/block_cells.h"

#include "vdbgeo/surface/cell_topology.h"

namespace vdbgeo {
namespace {

constexpr int dim = leaf::dim;
constexpr std::uint64_t every_byte = 0x0101010101010101ull;

/// Bits of the places with y < ny and z < nz.
std::uint64_t rectangle(int ny, int nz) {
    const std::uint64_t row = nz >= dim ? 0xFF : (1ull << nz) - 1;
    return row * (ny >= dim ? every_byte : every_byte & ((1ull << 8 * ny) - 1));
}

/// The number of set bits in each byte, as a byte.
std::uint64_t count_in_bytes(std::uint64_t word) {
    word -= word >> 1 & 0x5555555555555555ull;
    word = (word & 0x3333333333333333ull) + (word >> 2 & 0x3333333333333333ull);
    return (word + (word >> 4)) & 0x0F0F0F0F0F0F0F0Full;
}

/// Ambiguous faces with corners a, b, c, d, of which a and d, b and c are opposite.
std::uint64_t ambiguous(std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d) {
    return (a ^ b) & (a ^ c) & ~(a ^ d);
}

}  // namespace

void find_edges(const CornerSigns& s, const Vec3i& n, BlockCells& out) {
    const std::uint64_t in_box = rectangle(n.y(), n.z()), with_y = rectangle(n.y() - 1, n.z()),
                        with_z = rectangle(n.y(), n.z() - 1), with_both = rectangle(n.y() - 1, n.z() - 1);
    unsigned vertices = 0;
    for (int x = 0; x < dim; ++x) {
        const bool here = x < n.x(), with_x = x + 1 < n.x();
        const std::uint64_t corner = s.here[x];
        out.edges.crossed[0][x] = with_x ? (corner ^ s.here[x + 1]) & in_box : 0;
        out.edges.crossed[1][x] = here ? (corner ^ s.y[x]) & with_y : 0;
        out.edges.crossed[2][x] = here ? (corner ^ s.z[x]) & with_z : 0;
        const std::uint64_t in_row = count_in_bytes(out.edges.crossed[0][x]) +
                                     count_in_bytes(out.edges.crossed[1][x]) +
                                     count_in_bytes(out.edges.crossed[2][x]);
        const std::uint64_t up_to_row = in_row * every_byte;  // at most 192
        out.edges.row_first[x] = up_to_row << 8;
        out.edges.layer_first[x] = static_cast<std::uint16_t>(vertices);
        vertices += static_cast<unsigned>(up_to_row >> 56);
        const std::uint64_t any =
            corner | s.y[x] | s.z[x] | s.yz[x] | s.here[x + 1] | s.y[x + 1] | s.z[x + 1] | s.yz[x + 1];
        const std::uint64_t all =
            corner & s.y[x] & s.z[x] & s.yz[x] & s.here[x + 1] & s.y[x + 1] & s.z[x + 1] & s.yz[x + 1];
        out.active[x] = with_x ? any & ~all & with_both : 0;
    }
    out.edge_vertices = static_cast<std::uint16_t>(vertices);
}

bool find_ambiguous_faces(const CornerSigns& s, const cell::BlockBits active, cell::FaceBits& out) {
    std::uint64_t any = 0;
    for (int x = 0; x < dim; ++x) {
        const int next = x + 1;
        const auto keep = [&](std::uint64_t& word, std::uint64_t faces) {
            word = faces & active[x];
            any |= word;
        };
        keep(out.lower[0][x], ambiguous(s.here[x], s.y[x], s.z[x], s.yz[x]));
        keep(out.upper[0][x], ambiguous(s.here[next], s.y[next], s.z[next], s.yz[next]));
        keep(out.lower[1][x], ambiguous(s.here[x], s.here[next], s.z[x], s.z[next]));
        keep(out.upper[1][x], ambiguous(s.y[x], s.y[next], s.yz[x], s.yz[next]));
        keep(out.lower[2][x], ambiguous(s.here[x], s.here[next], s.y[x], s.y[next]));
        keep(out.upper[2][x], ambiguous(s.z[x], s.z[next], s.yz[x], s.yz[next]));
    }
    return any != 0;
}

void decide_faces(const CornerSigns& signs, const BlockSamples& samples, float isovalue,
                  cell::FaceBits& faces) {
    const double iso = isovalue;
    // Offsets of a face's four corners from its first, by the axis across it.
    constexpr int y = 12, x = BlockSamples::dim * 12;
    constexpr int u[3] = {y, x, x}, v[3] = {1, 1, y}, across[3] = {x, y, 1};
    const auto decide = [&](const float* at, int axis, bool first_inside) {
        const double a = at[0] - iso, b = at[u[axis]] - iso, c = at[v[axis]] - iso,
                     d = at[u[axis] + v[axis]] - iso;
        return first_inside ? cell::joined_across_face(a, d, b, c) : cell::joined_across_face(b, c, a, d);
    };
    for (int i = 0; i < dim; ++i)
        for (int axis = 0; axis < 3; ++axis)
            for (int side = 0; side < 2; ++side) {
                std::uint64_t& word = side ? faces.upper[axis][i] : faces.lower[axis][i];
                const std::uint64_t inside = !side       ? signs.here[i]
                                             : axis == 0 ? signs.here[i + 1]
                                             : axis == 1 ? signs.y[i]
                                                         : signs.z[i];
                std::uint64_t joined = 0;
                for (std::uint64_t left = word; left; left &= left - 1) {
                    const int bit = __builtin_ctzll(left);
                    const float* at = &samples.values[i][bit >> 3][bit & 7] + (side ? across[axis] : 0);
                    joined |= static_cast<std::uint64_t>(decide(at, axis, inside >> bit & 1)) << bit;
                }
                word = joined;
            }
}

}  // namespace vdbgeo
