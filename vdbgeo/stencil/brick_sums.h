// Sums over a grid that have the same bits whoever has which part of it.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

/// part(brick, sum) for every brick that the layout works on, in parallel, and all of it together. Sum begins
/// as nothing, and has add(const Sum&); the order must not matter to it, as it does not to ExactSum.
template <class Sum, class Part>
Sum sum_of_bricks(const BlockLayout& layout, const Part& part) {
    tbb::enumerable_thread_specific<Sum> sums;
    parallel_for(layout.brick_count(), 64, [&](std::size_t brick) {
        if (layout.works_on(brick)) part(brick, sums.local());
    });
    Sum all;
    for (const Sum& sum : sums) all.add(sum);
    return all;
}

}  // namespace vdbgeo::stencil
