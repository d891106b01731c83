// The inner loops of the operators, over the rows of one x-plane of a tile; one set for each kind of CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vdbgeo::stencil {

/// Kernels work on whole vectors of this many floats; rows are a multiple of it long, at most 16 of them.
constexpr int lanes = 16;

/// The z-range [begin, end) of a row outside of which no voxel is active; empty where begin ≥ end.
struct RowSpan {
    std::int16_t begin, end;
    bool solid = false;  ///< every voxel of the range is active
    /// Bit i: the i-th vector of `lanes` voxels of the row has active ones.
    std::uint16_t vectors = 0xffff;
};

/// Rows [y_begin, y_end) of a plane: where a kernel works. Rows are `stride` floats apart; spans[y] tells
/// which part of row y is needed. A kernel may compute more of a row: up to whole vectors. Inside of solid
/// ranges that the four rows around share, all faces are open; `before` and `after` are the spans of the
/// planes beside this one, not looked at where spans[y] is not solid.
struct PlaneRange {
    int y_begin, y_end;
    std::ptrdiff_t stride;
    const RowSpan *spans, *before = nullptr, *after = nullptr;
};

/// A plane and those before and after it along x.
struct Planes {
    const float *before, *here, *after;
};

/// Diffusivities of voxels that are not active are this: a face has the coefficient max(0, d_i + d_n), and
/// thus 0 where one side is not active (the band-edge rule) without any mask.
constexpr float inactive = -1e30f;

/// One step in one plane: next += relaxation · (here − next) + Σ_a weight_a Σ max(0, d_i + d_n)(w_n − w_i)
/// + gathered + fidelity · (target − here), where next holds u_{k−1} before and u_{k+1} after.
struct StepPlane {
    Planes w, d;
    const float* here;      ///< u_k
    float* next;            ///< u_{k−1}, becomes u_{k+1}
    const float* gathered;  ///< sum of the other orders' fluxes; null: none
    const float* target;    ///< null: none
    float weight[3];        ///< α τ w_a / 2 of the axes x, y, z
    float relaxation;       ///< α
    float fidelity;         ///< α τ β
};

struct Kernels {
    const char* name;
    /// out = L u = Σ_a w_a Σ (u_i − u_n) over the faces to active voxels; `d` tells which are.
    void (*laplacian)(const PlaneRange&, const Planes& u, const Planes& d, const float weight[3], float* out);
    /// out = Σ_a weight_a Σ max(0, d_i + d_n)(w_n − w_i), added to what is there or not.
    void (*flux)(const PlaneRange&, const Planes& w, const Planes& d, const float weight[3], bool add,
                 float* out);
    void (*step)(const PlaneRange&, const StepPlane&);
    /// Copies rows of 8 floats; `from` has them one behind the other, `to` has them `stride` apart.
    void (*spread)(const float* from, int rows, float* to, std::ptrdiff_t stride);
    /// The reverse for 8 rows, past the caches where the CPU can: `to` is on a cache line.
    void (*collect)(const float* from, std::ptrdiff_t stride, float* to);
    /// After the last `collect` of a thread's task: other threads see it from then on.
    void (*finish_writing)();
    /// Central differences times scale[a] in the rows of a plane, a missing neighbour having the voxel's own
    /// value; 0 in voxels that are not active. g: the components, or null; square: the sum of their squares.
    void (*gradient)(const PlaneRange&, const Planes& u, const Planes& active, const float scale[3],
                     float* const g[3], float* square);
    /// out[i] = Σ_{|k| ≤ r} in[i+k], or of its square, for i in [0, n); n is a multiple of `lanes`.
    void (*window_sum)(std::size_t n, int r, const float* in, bool squared, double* out);
    /// out[i] = Σ_k in[k][i] for k in [0, count).
    void (*sum_rows)(std::size_t n, int count, const double* const* in, double* out);
    /// variance = max(floor, factor (square/count − Σ_c (sums_c/count)²)), of one or three `components`.
    void (*variance)(std::size_t n, const double* count, const double* square, const double* const* sums,
                     int components, float factor, float floor, float* variance);
    /// out = d0 exp(−gradient2 / (2 variance)) where active, `inactive` elsewhere.
    void (*edge_stopping)(std::size_t n, const float* gradient2, const float* variance, const float* active,
                          float d0, float* out);
};

/// The kernel sets this CPU can run, the plainest first. All give the same bits: sums have one order, and
/// nothing is contracted to fused operations.
const std::vector<const Kernels*>& available_kernels();

/// The fastest of them, or the one that the environment variable VDBGEO_CPU names (baseline, avx2, avx512).
const Kernels& kernels();

}  // namespace vdbgeo::stencil
