// A cube of a sparse map as a dense array, smoothed where that pays.
#pragma once

#include <array>
#include <vector>

#include "vdbgeo/measure/gaussian_window.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The limits of a map's samples along an axis.
struct SampleRange {
    Vec3i low, high;
    explicit SampleRange(const Frame& frame);
};

/// Value, gradient and Hessian with respect to the index.
struct Derivatives {
    double value;
    Vec3d gradient;
    Mat3d hessian;
};

/// Derivatives of a map that is seen through a gaussian, at places in one cube after another.
///
/// A wide gaussian is made of two: a first that smooths the samples of the cube, axis by axis, and a narrow
/// one that is differentiated at each place; so a place costs the same for any width, and the cube pays for
/// the rest. A view belongs to one thread; the map must not change meanwhile.
class SmoothedView {
 public:
    /// Widths are in samples of each axis.
    SmoothedView(const DensityMap& map, const Vec3d& sigma);

    /// Edge of the cubes that fit the width: their places are [corner, corner + edge).
    static int edge_for(const Vec3d& sigma);

    /// Reads the cube at `corner` and what lies around it.
    void move_to(const openvdb::Coord& corner);
    /// Whether what was read has at most `most` different values (NaN apart): a mask, a constant.
    bool has_few_values(std::size_t most) const;
    /// Whether an index lies where derivatives may be asked for: in the cube.
    bool holds(const Vec3d& index) const;

    /// At an index in the cube; false where an axis has fewer than three samples, or a sample in the window
    /// is not finite.
    bool derivatives(const Vec3d& index, Derivatives& out) const;

 private:
    struct Axis {
        GaussianWindow narrow;
        GaussianWindow wide;
        bool smoothed;  ///< by `wide` first
    };

    static Axis axis_for(double sigma);
    void gather(const Vec3i& low, const Vec3i& size);
    void smooth(int axis);

    openvdb::FloatGrid::ConstAccessor reader_;
    SampleRange range_;
    std::array<Axis, 3> axes_;
    int edge_;
    openvdb::Coord corner_;
    Vec3i low_, size_;  // of what cube_ holds
    std::vector<double> cube_, other_;
    mutable std::vector<double> weights_;
};

}  // namespace vdbgeo
