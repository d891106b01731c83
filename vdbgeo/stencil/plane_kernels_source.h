// The loops themselves. Included by one source file for each kind of CPU, compiled for it, with
// VDBGEO_KERNELS the name of the set. Nothing here may instantiate a template or an inline function from
// elsewhere: the linker would keep one copy of it, perhaps the one for the newest CPU.
#if defined(__SSE__)
#include <immintrin.h>
#endif

#include "vdbgeo/stencil/plane_kernels.h"

namespace vdbgeo::stencil {
namespace {

/// The rows of a range that have active voxels, cut to whole vectors.
#define VDBGEO_FOR_ROWS(range, y, z0, z1)                                                     \
    for (int y = (range).y_begin; y < (range).y_end; ++y)                                     \
        if (const int z0 = (range).spans[y].begin / lanes * lanes, z1 = (range).spans[y].end, \
            vectors = (range).spans[y].vectors;                                               \
            z0 < z1)

/// One vector. `ivdep` is true: the arrays written to are read at the same place only.
#define VDBGEO_LANES(z, block) _Pragma("GCC ivdep") for (std::ptrdiff_t z = block; z < block + lanes; ++z)
#define VDBGEO_FOR_LANES(z, z0, z1)                             \
    for (std::ptrdiff_t block = z0; block < z1; block += lanes) \
        if (vectors >> (block / lanes) & 1) VDBGEO_LANES(z, block)

/// The same statement for vectors with all faces open (`solid` is true in it) and for the others.
#define VDBGEO_FOR_LANES_BY_FACES(range, y, z, z0, z1, ...)       \
    const Open open = open_part(range, y);                        \
    for (std::ptrdiff_t block = z0; block < z1; block += lanes) { \
        if (!(vectors >> (block / lanes) & 1)) continue;          \
        if (block >= open.begin && block + lanes <= open.end) {   \
            constexpr bool solid = true;                          \
            VDBGEO_LANES(z, block) __VA_ARGS__;                   \
        } else {                                                  \
            constexpr bool solid = false;                         \
            VDBGEO_LANES(z, block) __VA_ARGS__;                   \
        }                                                         \
    }

/// Where all faces of a row's voxels are open.
struct Open {
    int begin, end;
};
inline void cut(Open& open, const RowSpan& row, int margin) {
    if (!row.solid) open.end = 0;
    if (row.begin + margin > open.begin) open.begin = row.begin + margin;
    if (row.end - margin < open.end) open.end = row.end - margin;
}
inline bool fills_memory(const PlaneRange& range, int y) {
    return range.spans[y].end - range.spans[y].begin == range.stride;
}
inline Open open_part(const PlaneRange& range, int y) {
    Open open{0, 1 << 20};
    // The neighbours along z of a row that reaches to the end of its memory are in the halo, which no one
    // needs: where the next row in memory is active there, what comes out is some finite number.
    const bool goes_on = fills_memory(range, y - 1) && fills_memory(range, y) && fills_memory(range, y + 1);
    cut(open, range.spans[y], goes_on ? 0 : 1);
    if (open.end <= open.begin) return open;
    cut(open, range.spans[y - 1], 0);
    cut(open, range.spans[y + 1], 0);
    cut(open, range.before[y], 0);
    cut(open, range.after[y], 0);
    return open;
}

/// Coefficient of the face between two voxels, twice: 0 where one is not active.
template <bool solid>
inline float face(float a, float b) {
    const float sum = a + b;
    return solid || sum > 0.0f ? sum : 0.0f;
}

template <bool solid>
inline float if_active(float d, float difference) {
    return solid || d >= 0.0f ? difference : 0.0f;
}

/// L u of the voxel at offset o.
template <bool solid>
inline float laplacian_at(const Planes& u, const Planes& d, std::ptrdiff_t o, std::ptrdiff_t stride, float wx,
                          float wy, float wz) {
    const float *const c = u.here, *const m = d.here;
    const float v = c[o];
    const float x =
        if_active<solid>(d.before[o], v - u.before[o]) + if_active<solid>(d.after[o], v - u.after[o]);
    const float y = if_active<solid>(m[o - stride], v - c[o - stride]) +
                    if_active<solid>(m[o + stride], v - c[o + stride]);
    const float z = if_active<solid>(m[o - 1], v - c[o - 1]) + if_active<solid>(m[o + 1], v - c[o + 1]);
    return if_active<solid>(m[o], (wx * x + wy * y) + wz * z);
}

void laplacian(const PlaneRange& range, const Planes& u_in, const Planes& d_in, const float weight[3],
               float* result) {
    const Planes u = u_in, d = d_in;
    const float wx = weight[0], wy = weight[1], wz = weight[2];
    const std::ptrdiff_t stride = range.stride;
    VDBGEO_FOR_ROWS(range, y, z0, z1) {
        const std::ptrdiff_t o = y * stride;
        float* __restrict const out = result + o;
        VDBGEO_FOR_LANES_BY_FACES(range, y, z, z0, z1,
                                  out[z] = laplacian_at<solid>(u, d, o + z, stride, wx, wy, wz))
    }
}

/// The sum of a voxel's fluxes, weighted by axis. o: offset of the voxel.
template <bool solid>
inline float flux_at(const Planes& w, const Planes& d, std::ptrdiff_t o, std::ptrdiff_t stride, float wx,
                     float wy, float wz) {
    const float *const c = w.here, *const m = d.here;
    const float v = c[o], e = m[o];
    const float x =
        face<solid>(e, d.before[o]) * (w.before[o] - v) + face<solid>(e, d.after[o]) * (w.after[o] - v);
    const float y = face<solid>(e, m[o - stride]) * (c[o - stride] - v) +
                    face<solid>(e, m[o + stride]) * (c[o + stride] - v);
    const float z = face<solid>(e, m[o - 1]) * (c[o - 1] - v) + face<solid>(e, m[o + 1]) * (c[o + 1] - v);
    return (wx * x + wy * y) + wz * z;
}

void flux(const PlaneRange& range, const Planes& w_in, const Planes& d_in, const float weight[3], bool add,
          float* result) {
    const Planes w = w_in, d = d_in;
    const float wx = weight[0], wy = weight[1], wz = weight[2];
    const std::ptrdiff_t stride = range.stride;
    VDBGEO_FOR_ROWS(range, y, z0, z1) {
        float* __restrict const out = result + y * stride;
        const std::ptrdiff_t o = y * stride;
        if (add) {
            VDBGEO_FOR_LANES(z, z0, z1) out[z] += flux_at<false>(w, d, o + z, stride, wx, wy, wz);
        } else {
            VDBGEO_FOR_LANES(z, z0, z1) out[z] = flux_at<false>(w, d, o + z, stride, wx, wy, wz);
        }
    }
}

/// here − next is 0 where nothing changes, so constant regions stay what they are to the last bit.
#define VDBGEO_STEP(extra)     \
    VDBGEO_FOR_LANES_BY_FACES( \
        range, y, z, z0, z1,   \
        next[z] += a * (here[z] - next[z]) + (flux_at<solid>(w, d, o + z, stride, wx, wy, wz) extra))

void step(const PlaneRange& range, const StepPlane& s) {
    const Planes w = s.w, d = s.d;
    const float wx = s.weight[0], wy = s.weight[1], wz = s.weight[2], a = s.relaxation, f = s.fidelity;
    const std::ptrdiff_t stride = range.stride;
    VDBGEO_FOR_ROWS(range, y, z0, z1) {
        const std::ptrdiff_t o = y * stride;
        const float* const here = s.here + o;
        float* __restrict const next = s.next + o;
        const float *const more = s.gathered + (s.gathered ? o : 0), *const target =
                                                                         s.target + (s.target ? o : 0);
        if (s.gathered && s.target) {
            VDBGEO_STEP(+more[z] + f * (target[z] - here[z]))
        } else if (s.gathered) {
            VDBGEO_STEP(+more[z])
        } else if (s.target) {
            VDBGEO_STEP(+f * (target[z] - here[z]))
        } else {
            VDBGEO_STEP()
        }
    }
}

/// A row of a leaf.
struct Row {
    float values[8];
};

void spread(const float* from, int rows, float* to, std::ptrdiff_t stride) {
    for (int r = 0; r < rows; ++r, from += 8, to += stride) __builtin_memcpy(to, from, sizeof(Row));
}

void collect(const float* from, std::ptrdiff_t stride, float* to) {
#if defined(__AVX512F__)
    for (int r = 0; r < 8; r += 2, from += 2 * stride, to += 16)
        _mm512_stream_ps(to, _mm512_castpd_ps(_mm512_insertf64x4(
                                 _mm512_castps_pd(_mm512_castps256_ps512(_mm256_loadu_ps(from))),
                                 _mm256_castps_pd(_mm256_loadu_ps(from + stride)), 1)));
#elif defined(__AVX__)
    for (int r = 0; r < 8; ++r, from += stride, to += 8) _mm256_stream_ps(to, _mm256_loadu_ps(from));
#elif defined(__SSE__)
    for (int r = 0; r < 8; ++r, from += stride, to += 8) {
        _mm_stream_ps(to, _mm_loadu_ps(from));
        _mm_stream_ps(to + 4, _mm_loadu_ps(from + 4));
    }
#else
    for (int r = 0; r < 8; ++r, from += stride, to += 8) __builtin_memcpy(to, from, sizeof(Row));
#endif
}

/// Orders what `collect` wrote before what other threads read after a lock.
void finish_writing() {
#if defined(__SSE__)
    _mm_sfence();
#endif
}

/// e^x for −40 ≤ x ≤ 0, smaller x as −40: relative error below 3e-7. 2^n · 2^f with |f| ≤ ½, 2^f by its
/// Taylor series to the sixth power.
inline float exponential(float x) {
    const float y = (x < -40.0f ? -40.0f : x) * 1.44269504f;
    const float shifted = y + 12582912.0f;  // 1.5 · 2^23: rounds to an integer in the low bits
    const float n = shifted - 12582912.0f, g = (y - n) * 0.693147181f;
    const float p =
        1.0f + g * (1.0f + g * (0.5f + g * (0.166666667f + g * (0.0416666667f +
                                                                g * (0.00833333333f + g * 0.00138888889f)))));
    union {
        float value;
        std::int32_t bits;
    } scale;
    scale.bits = (static_cast<std::int32_t>(n) + 127) << 23;
    return p * scale.value;
}

void edge_stopping(std::size_t n, const float* __restrict gradient2, const float* __restrict variance,
                   const float* __restrict active, float d0, float* __restrict out) {
    for (std::size_t i = 0; i < n; ++i) {
        const float d = d0 * exponential(gradient2[i] * -0.5f / variance[i]);
        out[i] = active[i] > 0.0f ? d : inactive;
    }
}

/// (u_after − u_before)/2, with v in the place of what is not active.
inline float central(float v, float before, float has_before, float after, float has_after) {
    return (has_after > 0.0f ? after - v : 0.0f) + (has_before > 0.0f ? v - before : 0.0f);
}

void gradient(const PlaneRange& range, const Planes& u, const Planes& active, const float scale[3],
              float* const g[3], float* square) {
    const float sx = 0.5f * scale[0], sy = 0.5f * scale[1], sz = 0.5f * scale[2];
    const std::ptrdiff_t stride = range.stride;
    const float *const c = u.here, *const m = active.here, *const cb = u.before, *const ca = u.after,
                       *const mb = active.before, *const ma = active.after;
    float *const gx = g ? g[0] : nullptr, *const gy = g ? g[1] : nullptr, *const gz = g ? g[2] : nullptr;
    VDBGEO_FOR_ROWS(range, y, z0, z1) {
        const std::ptrdiff_t o = y * stride;
        const auto components = [=](std::ptrdiff_t i, float& x, float& yy, float& zz) {
            const float v = c[i], on = m[i] > 0.0f ? 1.0f : 0.0f;
            x = on * sx * central(v, cb[i], mb[i], ca[i], ma[i]);
            yy = on * sy * central(v, c[i - stride], m[i - stride], c[i + stride], m[i + stride]);
            zz = on * sz * central(v, c[i - 1], m[i - 1], c[i + 1], m[i + 1]);
        };
        if (g) {
            VDBGEO_FOR_LANES(z, z0, z1) {
                float x, yy, zz;
                components(o + z, x, yy, zz);
                gx[o + z] = x;
                gy[o + z] = yy;
                gz[o + z] = zz;
                square[o + z] = (x * x + yy * yy) + zz * zz;
            }
        } else {
            VDBGEO_FOR_LANES(z, z0, z1) {
                float x, yy, zz;
                components(o + z, x, yy, zz);
                square[o + z] = (x * x + yy * yy) + zz * zz;
            }
        }
    }
}

template <bool squared>
inline double term(float v) {
    const double d = v;
    return squared ? d * d : d;
}

template <bool squared>
void window_sum_of(std::size_t n, int r, const float* __restrict in, double* __restrict out) {
    if (r == 2) {  // the default, in one pass
        for (std::size_t i = 0; i < n; ++i) {
            const float* const at = in + i;
            out[i] = (((term<squared>(at[-2]) + term<squared>(at[-1])) + term<squared>(at[0])) +
                      term<squared>(at[1])) +
                     term<squared>(at[2]);
        }
        return;
    }
    for (std::size_t i = 0; i < n; ++i) out[i] = term<squared>(in[static_cast<std::ptrdiff_t>(i) - r]);
    for (int k = 1 - r; k <= r; ++k)
        for (std::size_t i = 0; i < n; ++i) out[i] += term<squared>(in[static_cast<std::ptrdiff_t>(i) + k]);
}

void window_sum(std::size_t n, int r, const float* in, bool squared, double* out) {
    if (squared)
        window_sum_of<true>(n, r, in, out);
    else
        window_sum_of<false>(n, r, in, out);
}

void sum_rows(std::size_t n, int count, const double* const* in, double* __restrict out) {
    if (count == 5) {
        const double *const a = in[0], *const b = in[1], *const c = in[2], *const d = in[3], *const e = in[4];
        for (std::size_t i = 0; i < n; ++i) out[i] = (((a[i] + b[i]) + c[i]) + d[i]) + e[i];
        return;
    }
    for (std::size_t i = 0; i < n; ++i) out[i] = in[0][i];
    for (int k = 1; k < count; ++k) {
        const double* __restrict const row = in[k];
        for (std::size_t i = 0; i < n; ++i) out[i] += row[i];
    }
}

inline float variance_of(double count, double square, double means, float factor, float floor) {
    const double one = 1.0 / (count > 0.5 ? count : 1.0);
    const float v = factor * static_cast<float>((square - means * one) * one);
    return v > floor ? v : floor;
}

void variance(std::size_t n, const double* __restrict count, const double* __restrict square,
              const double* const* sums, int components, float factor, float floor,
              float* __restrict result) {
    const double* __restrict const a = sums[0];
    if (components == 1) {
        for (std::size_t i = 0; i < n; ++i)
            result[i] = variance_of(count[i], square[i], a[i] * a[i], factor, floor);
        return;
    }
    const double* __restrict const b = sums[1], * __restrict const c = sums[2];
    for (std::size_t i = 0; i < n; ++i)
        result[i] =
            variance_of(count[i], square[i], (a[i] * a[i] + b[i] * b[i]) + c[i] * c[i], factor, floor);
}

}  // namespace

extern const Kernels VDBGEO_KERNELS;
#define VDBGEO_TEXT(name) #name
#define VDBGEO_NAME(name) VDBGEO_TEXT(name)
const Kernels VDBGEO_KERNELS = {VDBGEO_NAME(VDBGEO_KERNELS),
                                laplacian,
                                flux,
                                step,
                                spread,
                                collect,
                                finish_writing,
                                gradient,
                                window_sum,
                                sum_rows,
                                variance,
                                edge_stopping};

}  // namespace vdbgeo::stencil
