#include "vdbgeo/measure/shape_types.h"

#include <fmt/format.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

/// Of the median curvedness; see default_flatness.
constexpr double flat_share = 0.2;

using Weighted = std::pair<double, double>;  // value, area

void check_sizes(std::size_t values, std::size_t areas) {
    if (values != areas)
        throw InvalidInput(
            fmt::format("shape: {} values and {} areas, where each vertex has both", values, areas));
}

/// What has a value and an area, by value. Equal values by area, so that sums come out the same.
template <class Value>
Array<Weighted> sorted(const Array<double>& areas, const Value& value) {
    Array<Weighted> all;
    all.reserve(areas.size());
    for (std::size_t v = 0; v < areas.size(); ++v) {
        if (!(areas[v] >= 0) || !std::isfinite(areas[v]))
            throw InvalidInput(
                fmt::format("shape: the area of vertex {} is {}, where 0 or more is needed", v, areas[v]));
        const double x = value(v);
        if (std::isfinite(x) && areas[v] > 0) all.emplace_back(x, areas[v]);
    }
    tbb::parallel_sort(all.begin(), all.end());
    return all;
}

double total_area(const Array<Weighted>& all) {
    double total = 0;
    for (const Weighted& w : all) total += w.second;
    return total;
}

/// The least value at or below which `part` of the area is.
double percentile(const Array<Weighted>& all, double total, double part) {
    double below = 0;
    for (const Weighted& w : all)
        if ((below += w.second) >= part * total) return w.first;
    return all.back().first;
}

}  // namespace

const char* name_of(SurfaceType type) {
    static constexpr const char* names[] = {"peak", "ridge",  "saddle ridge", "flat", "minimal surface",
                                            "pit",  "valley", "saddle valley"};
    return names[static_cast<std::size_t>(type)];
}

double shape_index(double k1, double k2) {
    if (k1 == 0 && k2 == 0) return 0;
    return -2 / M_PI * std::atan2(k1 + k2, k1 - k2);
}

double curvedness(double k1, double k2) { return std::sqrt(0.5 * (k1 * k1 + k2 * k2)); }

SurfaceType surface_type(double k1, double k2, double flatness) {
    const auto sign = [](double k, double bound) { return k > bound ? 1 : k < -bound ? -1 : 0; };
    const int a = sign(k1, flatness), b = sign(k2, flatness), gaussian = a * b;
    const int mean = sign(0.5 * (k1 + k2), 0.5 * flatness);
    if (gaussian > 0) return a > 0 ? SurfaceType::peak : SurfaceType::pit;
    if (gaussian < 0)
        return mean > 0   ? SurfaceType::saddle_ridge
               : mean < 0 ? SurfaceType::saddle_valley
                          : SurfaceType::minimal;
    if (a == 0 && b == 0) return SurfaceType::flat;
    return a + b > 0 ? SurfaceType::ridge : SurfaceType::valley;
}

double default_flatness(const Curvatures& curvature, const Array<double>& areas) {
    check_sizes(curvature.size(), areas.size());
    const Array<Weighted> all =
        sorted(areas, [&](std::size_t v) { return curvedness(curvature.k1[v], curvature.k2[v]); });
    return all.empty() ? 0 : flat_share * percentile(all, total_area(all), 0.5);
}

std::array<double, surface_type_count> area_by_type(const Curvatures& curvature, const Array<double>& areas,
                                                    double flatness) {
    check_sizes(curvature.size(), areas.size());
    if (!(flatness >= 0))
        throw InvalidInput(fmt::format("shape: the flatness {} is not 0 or more", flatness));
    std::array<double, surface_type_count> by_type{};
    for (std::size_t v = 0; v < areas.size(); ++v) {
        const double k1 = curvature.k1[v], k2 = curvature.k2[v];
        if (std::isnan(k1) || std::isnan(k2)) continue;
        by_type[static_cast<std::size_t>(surface_type(k1, k2, flatness))] += areas[v];
    }
    return by_type;
}

AreaHistogram area_histogram(const Array<double>& values, const Array<double>& areas, std::size_t bins) {
    check_sizes(values.size(), areas.size());
    if (bins == 0) throw InvalidInput("shape: a histogram needs a bin or more");
    AreaHistogram h;
    h.area.assign(bins, 0.0);
    const Array<Weighted> all = sorted(areas, [&](std::size_t v) { return values[v]; });
    if (all.empty()) {
        h.mean = h.rms = h.median = h.p05 = h.p95 = std::numeric_limits<double>::quiet_NaN();
        return h;
    }
    const double total = total_area(all);
    h.low = percentile(all, total, 0.005);
    h.high = percentile(all, total, 0.995);
    h.p05 = percentile(all, total, 0.05);
    h.median = percentile(all, total, 0.5);
    h.p95 = percentile(all, total, 0.95);
    if (!(h.high > h.low)) {
        const double pad = h.low != 0 ? 0.5 * std::abs(h.low) : 0.5;
        h.low -= pad;
        h.high += pad;
    }
    for (const auto& [value, area] : all) h.mean += area * value;
    h.mean /= total;
    for (const auto& [value, area] : all) {
        h.rms += area * (value - h.mean) * (value - h.mean);
        const double at = (value - h.low) / (h.high - h.low) * static_cast<double>(bins);
        h.area[static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(bins - 1)))] += area;
    }
    h.rms = std::sqrt(h.rms / total);
    return h;
}

}  // namespace vdbgeo
