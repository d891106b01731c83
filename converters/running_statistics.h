// Statistics of samples that come piece by piece.
#pragma once

#include <cstddef>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Gathers Statistics over pieces of data. Within a piece the work is parallel; the result depends on how the
/// data was cut into pieces (in the last bits), not on the number of threads. Deviations are summed from each
/// block's own mean and joined after Chan, Golub and LeVeque (1983), so a large mean costs no accuracy.
class RunningStatistics {
 public:
    void add(const float* values, std::size_t count) { add_pieces(values, count, 1); }
    /// The same as add(…, piece) for each of `pieces` pieces that lie one behind the other.
    void add_pieces(const float* values, std::size_t piece, std::size_t pieces);
    Statistics result() const;

    /// Sums over some of the samples.
    struct Part {
        std::uint64_t count = 0, non_finite = 0;
        double min = std::numeric_limits<double>::infinity();
        double max = -std::numeric_limits<double>::infinity();
        double mean = 0, squares = 0;  // of the finite samples; squares of deviations from the mean
    };

 private:
    Part all_;
};

}  // namespace vdbgeo
