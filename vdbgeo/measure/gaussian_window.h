// A gaussian and its first two derivatives at any place between samples, one axis at a time.
#pragma once

#include <array>
#include <vector>

namespace vdbgeo {

/// Weights on samples at consecutive integers for the value, the slope and the second derivative at a place
/// x, of what a gaussian of standard deviation `sigma` (in samples) smooths.
///
/// Sampled derivatives of a gaussian are wrong by an amount that changes with the place between the samples.
/// So each set is the gaussian times the quadratic in d = i − x for which the sums come out as the integrals
/// do: Σw = 1, Σwd = 0, Σwd² = σ² for the value, 0, 1, 0 for the slope and 0, 0, 2 for the second derivative.
/// Polynomials of degree two are differentiated exactly (to rounding), wherever x is and however few of the
/// samples there are. The gaussian is lowered so that it ends at 0 at the last sample that it reaches.
class GaussianWindow {
 public:
    static constexpr int step = 4;  ///< the number of weights is a multiple of this

    explicit GaussianWindow(double sigma);

    int count() const { return count_; }
    /// The first sample of the window at x; the last is first + count − 1.
    int first(double x) const;

    /// Fills count() weights each; those of samples outside [low, high] are 0, and the derivatives become
    /// one-sided. False where fewer than three samples are left.
    bool fill(double x, int low, int high, double* value, double* slope, double* second) const;

 private:
    double sigma_;
    int count_;
    std::vector<double> gaussian_;  // at whole d from first(0)
    double floor_;                  // what the gaussian is lowered by
};

}  // namespace vdbgeo
