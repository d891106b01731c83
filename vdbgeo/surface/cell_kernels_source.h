// The loops themselves. Included by one source file for each kind of CPU, compiled for it, with
// VDBGEO_KERNELS the name of the set. Nothing here may instantiate a template or an inline function from
// elsewhere: the linker would keep one copy of it, perhaps the one for the newest CPU.
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "vdbgeo/surface/cell_kernels.h"

namespace vdbgeo::cell {
namespace {

constexpr int dim = block_dim;

void sign_words(const float* values, float isovalue, BlockBits words) {
#if defined(__AVX512F__)
    const __m512 iso = _mm512_set1_ps(isovalue);
    const auto bits = [&](int i) -> std::uint64_t {
        return _mm512_cmp_ps_mask(_mm512_loadu_ps(values + i), iso, _CMP_GE_OQ);
    };
#elif defined(__SSE2__)
    const __m128 iso = _mm_set1_ps(isovalue);
    const auto four = [&](int i) { return _mm_castps_si128(_mm_cmpge_ps(_mm_loadu_ps(values + i), iso)); };
    const auto bits = [&](int i) -> std::uint64_t {
        const __m128i low = _mm_packs_epi32(four(i), four(i + 4)),
                      high = _mm_packs_epi32(four(i + 8), four(i + 12));
        return static_cast<std::uint64_t>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
    };
#else
    const auto bits = [&](int i) {
        std::uint64_t out = 0;
        for (int k = 0; k < 16; ++k) out |= static_cast<std::uint64_t>(values[i + k] >= isovalue) << k;
        return out;
    };
#endif
    for (int x = 0; x < dim; ++x) {
        const int i = 64 * x;
        words[x] = bits(i) | bits(i + 16) << 16 | bits(i + 32) << 32 | bits(i + 48) << 48;
    }
}

Counts list_patterns(const BlockBits active, const std::uint64_t* const corners[8], const FaceBits* faces,
                     const std::uint16_t* of_key, std::uint16_t* patterns, OpenCell* open) {
    Counts n{0, 0};
    const auto list = [&](int x, int place, std::uint16_t pattern) {
        patterns[n.cells] = pattern;
        open[n.open] = {static_cast<std::uint16_t>(64 * x + place), static_cast<std::uint16_t>(n.cells)};
        n.open += pattern >> 15;
        ++n.cells;
    };
    for (int x = 0; x < dim; ++x) {
        if (!active[x]) continue;
#if defined(__AVX512BW__)
        alignas(64) std::uint16_t keys[64];
        __m512i low = _mm512_setzero_si512(), high = low;
        for (int c = 0; c < 8; ++c)
            low = _mm512_or_si512(low, _mm512_maskz_set1_epi8(corners[c][x], static_cast<char>(1 << c)));
        if (faces)
            for (int a = 0; a < 3; ++a) {
                high = _mm512_or_si512(
                    high, _mm512_maskz_set1_epi8(faces->lower[a][x], static_cast<char>(1 << 2 * a)));
                high = _mm512_or_si512(
                    high, _mm512_maskz_set1_epi8(faces->upper[a][x], static_cast<char>(2 << 2 * a)));
            }
        for (int half = 0; half < 2; ++half) {
            const __m256i signs = half ? _mm512_extracti64x4_epi64(low, 1) : _mm512_castsi512_si256(low),
                          joined = half ? _mm512_extracti64x4_epi64(high, 1) : _mm512_castsi512_si256(high);
            _mm512_store_si512(keys + 32 * half,
                               _mm512_or_si512(_mm512_cvtepu8_epi16(signs),
                                               _mm512_slli_epi16(_mm512_cvtepu8_epi16(joined), 8)));
        }
        for (std::uint64_t left = active[x]; left; left &= left - 1) {
            const int i = __builtin_ctzll(left);
            list(x, i, of_key[keys[i]]);
        }
#else
        for (std::uint64_t left = active[x]; left; left &= left - 1) {
            const int i = __builtin_ctzll(left);
            unsigned key = 0;
            for (int c = 0; c < 8; ++c) key |= static_cast<unsigned>(corners[c][x] >> i & 1) << c;
            if (faces)
                for (int a = 0; a < 3; ++a) {
                    key |= static_cast<unsigned>(faces->lower[a][x] >> i & 1) << (8 + 2 * a);
                    key |= static_cast<unsigned>(faces->upper[a][x] >> i & 1) << (9 + 2 * a);
                }
            list(x, i, of_key[key]);
        }
#endif
    }
    return n;
}

// As many at a time as the CPU's registers hold: of wider vectors the compiler makes scalar code.
#if defined(__AVX512F__)
constexpr int lanes = 8;
#elif defined(__AVX2__)
constexpr int lanes = 4;
#else
constexpr int lanes = 2;
#endif
using Floats = float __attribute__((vector_size(lanes * sizeof(float))));
using Doubles = double __attribute__((vector_size(lanes * sizeof(double))));
using Masks = long long __attribute__((vector_size(lanes * sizeof(long long))));

static_assert(tests_at_once % lanes == 0 && dim % lanes == 0);

void settle(const float* samples, float isovalue, SliceTest* tests, int count) {
    constexpr int row = sample_stride, layer = (dim + 1) * sample_stride;
    constexpr int column[4] = {0, layer, layer + row, row};  // around the slice
    const Doubles zero{};
    for (SliceTest* test = tests; test < tests + count; test += lanes) {
        alignas(64) float corner[2][4][lanes];
        alignas(64) long long first_diagonal[lanes];
        for (int i = 0; i < lanes; ++i) {
            const int cell = test[i].open.cell;
            const float* at = samples + (cell >> 6) * layer + (cell >> 3 & 7) * row + (cell & 7);
            for (int k = 0; k < 4; ++k) corner[0][k][i] = at[column[k]], corner[1][k][i] = at[column[k] + 1];
            first_diagonal[i] = test[i].diagonal ? 0 : -1;
        }
        Masks wanted;  // column k is inside in the slices looked at
        __builtin_memcpy(&wanted, first_diagonal, sizeof(wanted));
        Doubles low[4], rise[4], from = zero, to = zero + 1;
        for (int k = 0; k < 4; ++k, wanted = ~wanted) {
            Floats below, above;
            __builtin_memcpy(&below, corner[0][k], sizeof(below));
            __builtin_memcpy(&above, corner[1][k], sizeof(above));
            low[k] = __builtin_convertvector(below, Doubles) - static_cast<double>(isovalue);
            const Doubles high = __builtin_convertvector(above, Doubles) - static_cast<double>(isovalue);
            rise[k] = high - low[k];
            const Doubles t = low[k] / (low[k] - high);
            to = (((high >= zero) ^ wanted) & (t < to)) != 0 ? t : to;
            from = (((low[k] >= zero) ^ wanted) & (from < t)) != 0 ? t : from;
        }
        // Inside minus outside diagonal product, up to the sign: the arcs change where this does.
        const auto decide = [&](const Doubles& t, Doubles& out) {
            out = (low[0] + t * rise[0]) * (low[2] + t * rise[2]) -
                  (low[1] + t * rise[1]) * (low[3] + t * rise[3]);
        };
        Doubles q0, q1, half, at_from, at_to, at_extreme;
        decide(zero, q0);
        decide(zero + 1, q1);
        decide(zero + 0.5, half);
        const Doubles curve = 2 * (q0 + q1 - 2 * half), slope = q1 - q0 - curve;  // q0 + slope t + curve t²
        const Doubles extreme = -slope / (2 * curve);
        decide(from, at_from);
        decide(to, at_to);
        decide(extreme, at_extreme);
        const Masks begin = at_from >= zero, end = at_to >= zero, between = at_extreme >= zero;
        const Masks change =
            (from < to) & ((begin ^ end) | ((extreme > from) & (extreme < to) & (between ^ begin)));
        alignas(64) long long answer[lanes];
        __builtin_memcpy(answer, &change, sizeof(answer));
        for (int i = 0; i < lanes; ++i) test[i].change = answer[i] != 0;
    }
}

/// Every fourth bit of a word: bit 4·z is bit z.
struct Spread {
    std::uint32_t of[256];
};
constexpr Spread make_spread() {
    Spread spread{};
    for (unsigned byte = 0; byte < 256; ++byte)
        for (int z = 0; z < 8; ++z) spread.of[byte] |= (byte >> z & 1) << 4 * z;
    return spread;
}
constexpr Spread spread = make_spread();

/// The crossed edges of row (x, y), with the axis in the lower two bits of a bit's place and z above.
std::uint32_t row_edges(const EdgeBits& edges, int x, int y) {
    const auto row = [&](int a) { return spread.of[edges.crossed[a][x] >> 8 * y & 0xFF]; };
    return row(0) | row(1) << 1 | row(2) << 2;
}

void number_row(std::uint32_t crossed, std::uint32_t first, std::uint32_t* out) {
#if defined(__AVX512F__)
    const __m512i next = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const auto low = static_cast<__mmask16>(crossed), high = static_cast<__mmask16>(crossed >> 16);
    const auto numbers = [&](__mmask16 mask, unsigned from) {
        return _mm512_maskz_expand_epi32(mask,
                                         _mm512_add_epi32(next, _mm512_set1_epi32(static_cast<int>(from))));
    };
    _mm512_store_si512(out, numbers(low, first));
    _mm512_store_si512(out + 16, numbers(high, first + static_cast<unsigned>(__builtin_popcount(low))));
#else
    for (std::uint32_t left = crossed; left; left &= left - 1) out[__builtin_ctz(left)] = first++;
#endif
}

void take_numbers(const EdgeBits& edges, std::uint32_t first_vertex, int side, VertexNumbers& numbers) {
    const int x0 = side & 1 ? dim : 0, y0 = side & 2 ? dim : 0;
    const int nx = side & 1 ? 1 : dim, ny = side & 2 ? 1 : dim;
    for (int x = 0; x < nx; ++x) {
        if (!(edges.crossed[0][x] | edges.crossed[1][x] | edges.crossed[2][x])) continue;
        const std::uint32_t layer_first = first_vertex + edges.layer_first[x];
        for (int y = 0; y < ny; ++y) {
            const std::uint32_t first = layer_first + (edges.row_first[x] >> 8 * y & 0xFF);
            std::uint32_t(*row)[4] = numbers.of[x0 + x][y0 + y];
            if (side & 4) {
                row[dim][0] = first;
                row[dim][1] = first + static_cast<std::uint32_t>(edges.crossed[0][x] >> 8 * y & 1);
            } else if (const std::uint32_t crossed = row_edges(edges, x, y)) {
                number_row(crossed, first, row[0]);
            }
        }
    }
}

/// For the eight samples of a row the coordinate, along the edge to `next`, of the vertex there; `place`: of
/// the samples in the block.
void place_on_edges(const float* here, const float* next, const double place[dim], int axis,
                    const DiagonalPlacing& placing, float out[dim]) {
    const double iso = placing.isovalue;
    const Doubles zero{}, one = zero + 1, middle = zero + 0.5, least = zero + placing.nearest,
                          most = one - placing.nearest;
    for (int z = 0; z < dim; z += lanes) {
        Floats from, to;
        Doubles start;
        __builtin_memcpy(&from, here + z, sizeof(from));
        __builtin_memcpy(&to, next + z, sizeof(to));
        __builtin_memcpy(&start, place + z, sizeof(start));
        const Doubles low = __builtin_convertvector(from, Doubles) - iso,
                      high = __builtin_convertvector(to, Doubles) - iso;
        Doubles t = low / (low - high);
        t = (t >= zero) & (t <= one) ? t : middle;  // a sample is not a finite number
        t = t > least ? t : least;
        t = t < most ? t : most;
        t = placing.origin[axis] + placing.step[axis] * (placing.index[axis] + (start + t));
        const Floats at = __builtin_convertvector(t, Floats);
        __builtin_memcpy(out + z, &at, sizeof(at));
    }
}

void place_vertices(const float* samples, const EdgeBits& edges, const DiagonalPlacing& placing, float* out) {
    constexpr int row = sample_stride, layer = (dim + 1) * sample_stride;
    constexpr int most = 3 * dim * 3 + 1;  // floats that a row's vertices take, and one
    const auto coordinate = [&](int axis, int i) {
        return static_cast<float>(placing.origin[axis] + placing.step[axis] * (placing.index[axis] + i));
    };
    alignas(64) double zs[dim], xs[dim], ys[dim];
    alignas(16) float above[dim][4] = {};  // what z adds to the place of a sample
    for (int z = 0; z < dim; ++z) zs[z] = z, above[z][2] = coordinate(2, z);
    for (int x = 0; x < dim; ++x)
        for (int y = 0; y < dim; ++y) {
            const std::uint32_t crossed = row_edges(edges, x, y);
            if (!crossed) continue;
            const float* here = samples + x * layer + y * row;
            alignas(64) float moved[4][dim];
            for (int z = 0; z < dim; ++z) xs[z] = x, ys[z] = y;
            place_on_edges(here, here + layer, xs, 0, placing, moved[0]);
            place_on_edges(here, here + row, ys, 1, placing, moved[1]);
            place_on_edges(here, here + 1, zs, 2, placing, moved[2]);
            const float at_x = coordinate(0, x), at_y = coordinate(1, y);
#if defined(__SSE2__)
            if (placing.end - out >= most) {
                const __m128 column = _mm_setr_ps(at_x, at_y, 0, 0);
                for (std::uint32_t left = crossed; left; left &= left - 1, out += 3) {
                    const int bit = __builtin_ctz(left);
                    _mm_storeu_ps(out, _mm_or_ps(column, _mm_load_ps(above[bit >> 2])));
                    out[bit & 3] = moved[bit & 3][bit >> 2];
                }
                continue;
            }
#endif
            for (std::uint32_t left = crossed; left; left &= left - 1, out += 3) {
                const int bit = __builtin_ctz(left);
                out[0] = at_x, out[1] = at_y, out[2] = above[bit >> 2][2];
                out[bit & 3] = moved[bit & 3][bit >> 2];
            }
        }
}

/// The numbers around the cell whose first corner has the numbers at `cell`.
void gather_numbers(const std::uint32_t* cell, std::uint32_t* out) {
    constexpr int row = 12 * 4, layer = VertexNumbers::dim * row;
    __builtin_memcpy(out, cell, 32);
    __builtin_memcpy(out + 8, cell + row, 32);
    __builtin_memcpy(out + 16, cell + layer, 32);
    __builtin_memcpy(out + 24, cell + layer + row, 32);
}

void draw(const DrawingTask& task) {
    const Drawing& drawing = task.drawing;
    const std::uint16_t* pattern = task.pattern;
    std::uint32_t* out = task.out;
    for (int x = 0; x < dim; ++x)
        for (std::uint64_t left = task.active[x]; left; left &= left - 1) {
            const int i = __builtin_ctzll(left);
            const int p = *pattern++, n = drawing.corners[p];
            const std::uint32_t* cell = task.numbers->of[x][i >> 3][i & 7];
            const bool roomy = task.end - out >= 32;
#if defined(__AVX512F__)
            if (__builtin_expect(n <= 32 && roomy, 1)) {
                constexpr int row = 12 * 4, layer = VertexNumbers::dim * row;
                const auto two_rows = [](const std::uint32_t* from) {
                    return _mm512_inserti64x4(
                        _mm512_castsi256_si512(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from))),
                        _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from + row)), 1);
                };
                const __m512i lower = two_rows(cell), upper = two_rows(cell + layer);
                const auto corners = [&](const Drawing::Places& places) {
                    const __m128i bytes = _mm_load_si128(reinterpret_cast<const __m128i*>(places.place));
                    return _mm512_permutex2var_epi32(lower, _mm512_cvtepu8_epi32(bytes), upper);
                };
                _mm512_storeu_si512(out, corners(drawing.first[p]));
                if (n > 16) _mm512_storeu_si512(out + 16, corners(drawing.more[p]));
                out += n;
                continue;
            }
#endif
            std::uint32_t numbers[cell_numbers];
            gather_numbers(cell, numbers);
            if (n & Drawing::special) {
                task.draw_special(task.context, x, i >> 3, i & 7, p, numbers, out);
                out += n - Drawing::special;
                continue;
            }
            int k = 0;
            const std::uint8_t* place = drawing.first[p].place;
            if (roomy)
                for (; k < 9; ++k) out[k] = numbers[place[k]];
            for (; k < n && k < 16; ++k) out[k] = numbers[place[k]];
            place = drawing.more[p].place;
            for (; k < n; ++k) out[k] = numbers[place[k - 16]];
            out += n;
        }
}

}  // namespace

extern const Kernels VDBGEO_KERNELS;
#define VDBGEO_TEXT(name) #name
#define VDBGEO_NAME(name) VDBGEO_TEXT(name)
const Kernels VDBGEO_KERNELS = {
    VDBGEO_NAME(VDBGEO_KERNELS), sign_words, list_patterns, settle, take_numbers, place_vertices, draw};

}  // namespace vdbgeo::cell
