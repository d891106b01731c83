// Times programs against each other: all in one process, in turns, so that what slows the machine for a while
// slows them all.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vdbgeo::bench {

/// What one run gives back. `keep` holds the result's memory: it is freed after the clock has stopped.
struct Output {
    std::uint64_t triangles = 0, vertices = 0;
    std::shared_ptr<void> keep;
};

struct Contender {
    std::string program;
    std::function<Output()> run;
    std::optional<std::uint64_t> leaves, surface_leaves;  ///< of the grid that it reads

    std::vector<double> wall{}, cpu{};  ///< seconds of each timed run; cpu: user + system, all threads
    Output last{};
};

/// One untimed round, then `repeat` rounds in which each contender runs once.
void race(std::vector<Contender>& contenders, int repeat);

/// One JSON object on a line of standard output. The peak memory is the process's: it is told only where the
/// contender was alone in it.
struct Report {
    std::string task, input;
    double isovalue = 0;
    int threads = 1;
    bool alone = false;

    void print(const Contender& contender) const;
};

}  // namespace vdbgeo::bench
