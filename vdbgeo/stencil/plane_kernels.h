// The inner loops of the operators, over the rows of one x-plane of a tile; one set for each kind of CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vdbgeo::stencil {

/// The z-range [begin, end) of a row outside of which no voxel is active; empty where begin ≥ end.
struct RowSpan {
    std::int16_t begin, end;
};

/// Kernels work on whole vectors of this many floats; rows are a multiple of it long.
constexpr int lanes = 16;

/// Rows [y_begin, y_end) of a plane: where a kernel works. Rows are `stride` floats apart; spans[y] tells which
/// part of row y is needed. A kernel may compute more of a row: up to whole vectors.
struct PlaneRange {
    int y_begin, y_end;
    std::ptrdiff_t stride;
    const RowSpan* spans;
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
    void (*flux)(const PlaneRange&, const Planes& w, const Planes& d, const float weight[3], bool add, float* out);
    void (*step)(const PlaneRange&, const StepPlane&);
    /// Diffusivity of Eqs 3, 4 from |∇u|² and the window's variance; see diffusivity.cpp.
    void (*edge_stopping)(std::size_t n, const float* gradient2, const float* variance, float d0, float* out);
};

/// The kernel sets this CPU can run, the plainest first. All give the same bits: sums have one order, and
/// nothing is contracted to fused operations.
const std::vector<const Kernels*>& available_kernels();

/// The fastest of them, or the one that the environment variable VDBGEO_CPU names (baseline, avx2, avx512).
const Kernels& kernels();

}  // namespace vdbgeo::stencil
