// Test specimens with a known truth: analytic shapes, simulated specimens, and noise.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/specimen.h"

namespace vdbgeo {

/// The analytic fields, in Å: positive inside, zero on the surface, so that the density falls along the
/// outward normal. p is relative to the centre of the shape; lengths are positive.
///
/// Signed distance R - |p|. Area 4πR², volume 4πR³/3; curvatures 1/R.
double sphere_field(const Vec3d& p, double radius);
/// Signed distance to the torus around z with tube radius r < R: r - |(ρ - R, z)|, ρ = |(x, y)|.
/// Area 4π²Rr, volume 2π²Rr².
double torus_field(const Vec3d& p, double radius, double minor_radius);
/// Signed distance to the closed cylinder around z, |z| ≤ h/2. Area 2πR(R + h), volume πR²h.
double cylinder_field(const Vec3d& p, double radius, double height);
/// (x² - y²) / 2a - z: the saddle z = (x² - y²) / 2a, dense below; its curvatures at the origin are ±1/a. Not
/// a distance.
double saddle_field(const Vec3d& p, double radius);
/// c cosh(z/c) - ρ: the catenoid with neck radius c, a minimal surface (H = 0, K = -1/(c² cosh⁴(z/c))), dense
/// around the axis. Not a distance.
double catenoid_field(const Vec3d& p, double radius);
/// sin X cos Y + sin Y cos Z + sin Z cos X with X = 2πx/L, ...: the gyroid's level-set form, period L. It
/// halves space: volume L³/2 in each cell. No unit; not a distance.
double gyroid_field(const Vec3d& p, double period);

/// Every kind, the analytic shapes first.
std::vector<PhantomKind> phantom_kinds();

struct PhantomOptions {
    std::string kind = "sphere";  ///< one of phantom_kinds()
    int size = 128;               ///< samples along each axis, 2…16384
    /// Å; lengths are 1e-6 to 1e6. Unset: the shape fills 80 % of the box. Open shapes fill the box: it is
    /// then 2 radii wide for the saddle, 6 for the catenoid, two periods for the gyroid.
    std::optional<double> voxel_size;
    /// Å. sphere 100, torus 100, cylinder 60; saddle 100 (a) and catenoid 40 (c). No other kind takes it.
    std::optional<double> radius;
    std::optional<double> minor_radius;  ///< Å, torus only: 40; below `radius`
    std::optional<double> height;        ///< Å, cylinder only: 160
    std::optional<double> period;        ///< Å, gyroid only: 100
    /// Variance of the truth inside the particle (where it is above 5 % of its maximum) over the variance of
    /// white Gaussian noise. Unset: no noise.
    std::optional<double> snr;
    std::uint64_t seed = 0;  ///< of the noise

    /// Throws InvalidInput for an unknown kind, a value out of range, or an option the kind does not take.
    void check() const;
};

/// Standard normal noise of voxel (x, y, z), a function of its arguments alone (|value| < 7). Indices from 0
/// to 2²¹ - 1. A counter-based generator: the voxel's index and the seed go through two rounds of the
/// splitmix64 finaliser (Steele, Lea & Flood, doi:10.1145/2714064.2660195), then Box–Muller for two
/// neighbours along x.
float voxel_noise(std::uint64_t seed, int x, int y, int z);

/// A phantom, evaluated where it is asked for: nothing is stored but the shape, and any section in any order,
/// with any number of threads, has the same bits.
///
/// Specimens have density about 1 in the bulk and 0 in the solvent (part_field.h); analytic shapes have the
/// field of the functions above, rounded to float. The box is centred on the world's origin.
///
/// Cost: a few ns a voxel and thread, noise about 10 ns more. With `snr` set, construction evaluates the
/// truth twice to learn its variance.
class Phantom {
 public:
    /// Throws InvalidInput for bad options, and where `snr` is asked of a phantom that has no variance inside
    /// the box.
    explicit Phantom(const PhantomOptions& options, const Progress& progress = {});

    const Frame& frame() const { return frame_; }
    /// The value whose level set is the surface: 0 for analytic shapes, 0.5 for specimens.
    double isovalue() const { return isovalue_; }
    /// Standard deviation of the noise; 0 without noise.
    double noise_sigma() const { return noise_sigma_; }

    /// Sections [z0, z1), x fastest, with noise where `snr` is set. Throws InvalidInput outside the box.
    void sections(int z0, int z1, float* out) const;
    /// The same without noise.
    void truth_sections(int z0, int z1, float* out) const;

 private:
    /// Rows [y0, y1) of section z of the truth.
    using Rows = std::function<void(int z, int y0, int y1, float* out)>;

    void evaluate(int z0, int z1, float noise_sigma, float* out) const;
    double particle_variance(const Progress& progress) const;

    Frame frame_;
    Rows rows_;
    double isovalue_ = 0, noise_sigma_ = 0;
    std::uint64_t seed_ = 0;
};

}  // namespace vdbgeo
