#include "tests/bench/harness.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>

namespace vdbgeo::bench {
namespace {

double wall_seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double cpu_seconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double peak_rss_mib() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024;
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

std::string or_null(const std::optional<std::uint64_t>& value) {
    return value ? fmt::format("{}", *value) : "null";
}

}  // namespace

void race(std::vector<Contender>& contenders, int repeat) {
    for (int round = 0; round <= repeat; ++round)
        for (Contender& c : contenders) {
            c.last = {};
            const double wall = wall_seconds(), cpu = cpu_seconds();
            c.last = c.run();
            if (round > 0) {
                c.wall.push_back(wall_seconds() - wall);
                c.cpu.push_back(cpu_seconds() - cpu);
            }
            c.last.keep.reset();
        }
}

void Report::print(const Contender& c) const {
    fmt::print(
        R"({{"program": "{}", "task": "{}", "input": "{}", "iso": {}, "threads": {}, )"
        R"("seconds_median": {:.6f}, "seconds_min": {:.6f}, "cpu_seconds_median": {:.6f}, "runs": {}, )"
        R"("triangles": {}, "vertices": {}, "peak_rss_mib": {}, "leaves": {}, "surface_leaves": {}}})"
        "\n",
        c.program, task, input, isovalue, threads, median(c.wall),
        *std::min_element(c.wall.begin(), c.wall.end()), median(c.cpu), c.wall.size(), c.last.triangles,
        c.last.vertices, alone ? fmt::format("{:.1f}", peak_rss_mib()) : "null", or_null(c.leaves),
        or_null(c.surface_leaves));
}

}  // namespace vdbgeo::bench
