// Parallel loops whose results do not depend on the number of threads.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <vector>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace vdbgeo {

namespace detail {

/// Tells the thread sanitizer what the scheduler's library, which is not instrumented, keeps from it: what
/// was written before a loop is seen in it, and what was written in a loop is seen after it. Nothing in other
/// builds.
class LoopFence {
 public:
#ifdef __SANITIZE_THREAD__
    LoopFence() { __tsan_release(&mark_); }
    ~LoopFence() { __tsan_acquire(&mark_); }
    void enter() { __tsan_acquire(&mark_); }
    void leave() { __tsan_release(&mark_); }

 private:
    char mark_ = 0;
#else
    void enter() {}
    void leave() {}
#endif
};

/// A thread's turn in a loop, which may end by an exception.
class LoopTurn {
 public:
    explicit LoopTurn(LoopFence& fence) : fence_(fence) { fence_.enter(); }
    ~LoopTurn() { fence_.leave(); }

 private:
    LoopFence& fence_;
};

}  // namespace detail

/// Calls body(i) for i in [0, count), `grain` neighbours at a time to one thread.
template <class Body>
void parallel_for(std::size_t count, std::size_t grain, const Body& body) {
    detail::LoopFence fence;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
        const detail::LoopTurn turn(fence);
        for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
    });
}

/// Reduces [0, count) in blocks of a fixed size: part(begin, end) → T for each block in parallel, then
/// join(T&, const T&) over the blocks from first to last. The order of the additions is a function of count
/// and block alone, so floating-point sums come out with the same bits for any number of threads.
template <class T, class Part, class Join>
T fixed_order_reduce(std::size_t count, std::size_t block, T start, const Part& part, const Join& join) {
    const std::size_t blocks = (count + block - 1) / block;
    std::vector<T> partial(blocks, start);
    parallel_for(blocks, 1, [&](std::size_t b) {
        const std::size_t begin = b * block, end = begin + block < count ? begin + block : count;
        partial[b] = part(begin, end);
    });
    for (const T& value : partial) join(start, value);
    return start;
}

/// Runs body(begin, end) for consecutive blocks of a fixed size; the blocks are the same for any number of
/// threads.
template <class Body>
void parallel_blocks(std::size_t count, std::size_t block, const Body& body) {
    const std::size_t blocks = (count + block - 1) / block;
    parallel_for(blocks, 1, [&](std::size_t b) {
        const std::size_t begin = b * block, end = begin + block < count ? begin + block : count;
        body(begin, end);
    });
}

}  // namespace vdbgeo
