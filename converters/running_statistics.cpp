#include "converters/running_statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

using Part = RunningStatistics::Part;

Part part_of(const float* begin, const float* end) {
    Part part;
    float low = std::numeric_limits<float>::infinity(), high = -low;
    double sum = 0;
    for (const float* v = begin; v != end; ++v) {
        if (!std::isfinite(*v)) {
            ++part.non_finite;
            continue;
        }
        low = std::min(low, *v);
        high = std::max(high, *v);
        sum += *v;
    }
    part.count = static_cast<std::uint64_t>(end - begin);
    const double finite = static_cast<double>(part.count - part.non_finite);
    if (finite == 0) return part;
    part.min = low;
    part.max = high;
    part.mean = sum / finite;
    for (const float* v = begin; v != end; ++v)
        if (std::isfinite(*v)) part.squares += (*v - part.mean) * (*v - part.mean);
    return part;
}

void join(Part& all, const Part& part) {
    const double a = static_cast<double>(all.count - all.non_finite);
    const double b = static_cast<double>(part.count - part.non_finite);
    all.count += part.count;
    all.non_finite += part.non_finite;
    if (b == 0) return;
    all.min = std::min(all.min, part.min);
    all.max = std::max(all.max, part.max);
    const double step = part.mean - all.mean;
    all.mean += step * b / (a + b);
    all.squares += part.squares + step * step * a * b / (a + b);
}

}  // namespace

void RunningStatistics::add_pieces(const float* values, std::size_t piece, std::size_t pieces) {
    constexpr std::size_t block = 1 << 16;
    const std::size_t blocks = (piece + block - 1) / block;
    std::vector<Part> parts(blocks * pieces);
    parallel_for(parts.size(), 1, [&](std::size_t i) {
        const std::size_t begin = i % blocks * block;
        const float* from = values + i / blocks * piece;
        parts[i] = part_of(from + begin, from + std::min(begin + block, piece));
    });
    for (std::size_t p = 0; p < pieces; ++p) {
        Part sum;
        for (std::size_t b = 0; b < blocks; ++b) join(sum, parts[p * blocks + b]);
        join(all_, sum);
    }
}

Statistics RunningStatistics::result() const {
    Statistics s;
    s.count = all_.count;
    s.non_finite = all_.non_finite;
    s.min = all_.min;
    s.max = all_.max;
    s.mean = all_.mean;
    const double finite = static_cast<double>(all_.count - all_.non_finite);
    s.rms = finite > 0 ? std::sqrt(all_.squares / finite) : 0;
    return s;
}

}  // namespace vdbgeo
