#include "converters/running_statistics.h"

#include <algorithm>
#include <cmath>

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

void RunningStatistics::add(const float* values, std::size_t count) {
    const Part piece = fixed_order_reduce(
        count, 1 << 16, Part(),
        [&](std::size_t begin, std::size_t end) { return part_of(values + begin, values + end); }, join);
    join(all_, piece);
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
