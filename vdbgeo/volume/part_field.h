// A smooth density built from blobs and tubes, evaluated row by row.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// A blob (a = b) or a tube with round ends around the segment a–b. Lengths in Å. `radius`: where the surface
/// of the part lies while no other part is near.
struct Part {
    std::string name;
    Vec3d a, b;
    double radius;
};

/// The density of a set of parts,
///     density = s² / (1 + s²),   s(p) = Σ 2 max(0, 1 - d²/R²)³,   R = radius / √(1 - 2^(-1/3)) ≈ 2.2 radius,
/// with d the distance from p to the part's segment. The bell stands in for a Gaussian: it looks the same, it
/// ends exactly at R, so that nothing is cut off, and needs no exponential; it is twice continuously
/// differentiable. s = 1 is density 0.5, which lies at `radius` around a lone part; the density is 0.8 on its
/// axis and tends to 1 where parts overlap: the bulk is flat, as in a filtered map of a protein.
class PartField {
 public:
    /// Samples sit at (i - (size-1)/2) · voxel_size on each axis, in Å: a cube centred on the world's origin.
    PartField(const std::vector<Part>& parts, int size, double voxel_size);

    /// Rows [y0, y1) of section z, x fastest. The parts are added in their order, row by row, so the bits do
    /// not depend on how the volume is cut up. Single precision: within 1e-5 of `value`. Cost: the voxels
    /// inside the parts' supports.
    void rows(int z, int y0, int y1, float* out) const;

 private:
    /// A part in index units.
    struct Prepared {
        Vec3d a, ab;         ///< start and extent of the segment
        Vec3d direction;     ///< of the segment; zero for a blob
        double inv_length2;  ///< zero for a blob
        double support;      ///< R
        Vec3i low, high;     ///< the box of samples it may touch: [low, high)
    };
    void add_row(const Prepared& part, int y, int z, float* row) const;

    int size_;
    std::vector<Prepared> parts_;
    std::vector<std::vector<std::uint32_t>> parts_of_section_;
};

/// The density of `parts` at one point, in double and by the definition: every part is visited.
double part_density(const std::vector<Part>& parts, const Vec3d& p);

}  // namespace vdbgeo
