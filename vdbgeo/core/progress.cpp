#include "vdbgeo/core/progress.h"

#include <algorithm>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void Progress::report(double fraction) const {
    if (!callback_ || !*callback_) return;
    const double inside = std::clamp(fraction, 0.0, 1.0);
    if (!(*callback_)(from_ + (to_ - from_) * inside)) throw Cancelled();
}

Progress Progress::part(double from, double to) const {
    Progress result = *this;
    result.from_ = from_ + (to_ - from_) * from;
    result.to_ = from_ + (to_ - from_) * to;
    return result;
}

}  // namespace vdbgeo
