// OpenVDB's long tools ask an interrupter whether to go on; this one asks a Progress.
#pragma once

#include <openvdb/util/NullInterrupter.h>

#include <algorithm>
#include <atomic>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Hand it to a tool, then call `check()`: a tool that was interrupted just returns what it has.
class Interrupter : public openvdb::util::NullInterrupter {
 public:
    explicit Interrupter(const Progress& progress) : progress_(progress) {}

    bool wasInterrupted(int percent = -1) override {
        if (stopped_) return true;
        try {
            if (percent >= 0) percent_ = std::min(percent, 100);
            progress_.report(percent_ / 100.0);
        } catch (const Cancelled&) {  // must not fly through the tool's own threads
            stopped_ = true;
        }
        return stopped_;
    }

    /// Throws Cancelled where the tool was interrupted.
    void check() const {
        if (stopped_) throw Cancelled();
    }

 private:
    Progress progress_;
    std::atomic<int> percent_{0};
    std::atomic<bool> stopped_{false};
};

}  // namespace vdbgeo
