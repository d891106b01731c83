// Progress reports and cancelling, passed down by value through every long computation.
#pragma once

#include <functional>
#include <memory>

namespace vdbgeo {

/// Tells how far a computation is (0…1) and asks whether to go on. A default-made Progress is silent and
/// never cancels. Copies share the callback; `part` gives a sub-computation its share of the whole, so
/// computations nest. `report` may be called from any thread: the callback has to allow that.
class Progress {
 public:
    /// Receives the fraction done; returns false to cancel.
    using Callback = std::function<bool(double fraction)>;

    Progress() = default;
    explicit Progress(Callback callback) : callback_(std::make_shared<Callback>(std::move(callback))) {}

    /// Reports `fraction` of this part; throws Cancelled when the callback says stop.
    void report(double fraction) const;

    /// The share [from, to] of this progress.
    Progress part(double from, double to) const;

 private:
    std::shared_ptr<Callback> callback_;
    double from_ = 0, to_ = 1;
};

}  // namespace vdbgeo
