// Whether, where and how often a computation writes down where it is.
#pragma once

#include <filesystem>
#include <functional>

namespace vdbgeo {

struct CheckpointOptions {
    std::filesystem::path folder;  ///< empty: no checkpoints
    int every = 1;                 ///< cycles between two of them
    bool resume = false;           ///< goes on from the newest one that is whole; anew where there is none
    /// Asked after each cycle, and of all members: true where it is time to write one and to end.
    std::function<bool()> stop;
};

}  // namespace vdbgeo
