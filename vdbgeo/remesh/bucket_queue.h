// A queue of numbered elements by their costs, in constant time.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Elements come out by cost to a quarter of an octave, and among those in the order in which they came in:
/// near enough to a heap's order for greedy work, without its logarithm, and neighbours that come in together
/// come out together, which the caches like. 8 bytes an element.
class BucketQueue {
 public:
    static constexpr std::uint32_t none = 0xFFFFFFFFu;

    explicit BucketQueue(std::size_t elements) : links_(elements), buckets_(1u << 10) {}

    /// The element must not be in the queue; the cost must be finite and not below 0.
    void push(std::uint32_t element, float cost) {
        const std::uint32_t b = bucket_of(cost);
        Bucket& bucket = buckets_[b];
        links_[element] = {bucket.last, none};
        (bucket.last == none ? bucket.first : links_[bucket.last].after) = element;
        bucket.last = element;
        if (b < lowest_) lowest_ = b;
    }

    /// `cost` must be the one with which the element was pushed.
    void remove(std::uint32_t element, float cost) {
        Bucket& bucket = buckets_[bucket_of(cost)];
        const Link link = links_[element];
        (link.before == none ? bucket.first : links_[link.before].after) = link.after;
        (link.after == none ? bucket.last : links_[link.after].before) = link.before;
    }

    /// The next element, which stays in the queue; `none` when it is empty.
    std::uint32_t front() {
        while (lowest_ < buckets_.size() && buckets_[lowest_].first == none) ++lowest_;
        return lowest_ < buckets_.size() ? buckets_[lowest_].first : none;
    }

    /// The one after an element of the queue, as long as it is of like cost; else `none`. For prefetching.
    std::uint32_t after(std::uint32_t element) const { return links_[element].after; }

 private:
    struct Link {
        std::uint32_t before, after;
    };
    struct Bucket {
        std::uint32_t first = none, last = none;
    };

    static std::uint32_t bucket_of(float cost) {
        const float positive = cost > 0 ? cost : 0;  // −0 has its sign bit set
        std::uint32_t bits = 0;
        std::memcpy(&bits, &positive, sizeof(bits));
        return bits >> 21;
    }

    Array<Link> links_;
    std::vector<Bucket> buckets_;
    std::size_t lowest_ = 0;
};

}  // namespace vdbgeo
