// Those who work on one thing together, each on a part of it: threads, or processes on several machines.
#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <type_traits>
#include <vector>

namespace vdbgeo {

/// Every member calls the same functions in the same order, each from one thread. What they agree on, and so
/// what each of them goes on to do, depends on what all gave, in the order of their ranks, and on nothing
/// else.
///
/// A member that throws takes all down: whoever runs the members has to see to that.
class Team {
 public:
    virtual ~Team() = default;

    virtual int size() const = 0;
    virtual int rank() const = 0;

    /// What every member gave, by rank.
    virtual std::vector<std::vector<char>> gather(const std::vector<char>& mine) = 0;
    /// Gives to[r] to each member r, and returns what each gave this one, by rank.
    virtual std::vector<std::vector<char>> exchange(const std::vector<std::vector<char>>& to) = 0;
    /// Adds up, number by number, what all gave; all give equally many.
    virtual void add_up(std::vector<std::uint64_t>& numbers) = 0;

    /// Returns once all have called it. Who waits leaves the processor to others, which work meanwhile.
    virtual void rest_until_all_come() { gather({}); }

    /// Messages of floats from one member to another arrive in their order, where they have one tag. Who
    /// sends has the one end, who receives the other, for as many messages as they like.
    class Outgoing {
     public:
        virtual ~Outgoing() = default;
        /// Where to put the next message, of so many floats; waits until the last one has left.
        virtual float* buffer(std::size_t count) = 0;
        /// Sends what was put there, and returns at once.
        virtual void send() = 0;
    };
    class Incoming {
     public:
        virtual ~Incoming() = default;
        /// A message of so many floats is to come: it can begin to from now on.
        virtual void expect(std::size_t count) = 0;
        /// Waits for the one that was expected, which is there until the next is expected.
        virtual const float* take() = 0;
    };
    virtual std::unique_ptr<Outgoing> outgoing(int to, int tag) = 0;
    virtual std::unique_ptr<Incoming> incoming(int from, int tag) = 0;

    /// Lets messages move that are on their way: called now and then by who computes.
    virtual void move_messages() {}
};

namespace detail {

template <class T>
std::vector<char> as_bytes(const std::vector<T>& records) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto* bytes = reinterpret_cast<const char*>(records.data());
    return {bytes, bytes + records.size() * sizeof(T)};
}

/// What lies in the parts, one behind the other.
template <class T>
std::vector<T> join(const std::vector<std::vector<char>>& parts) {
    std::vector<T> all;
    for (const std::vector<char>& part : parts) {
        const std::size_t before = all.size();
        all.resize(before + part.size() / sizeof(T));
        if (!part.empty()) std::memcpy(all.data() + before, part.data(), part.size());
    }
    return all;
}

}  // namespace detail

/// What every member gave, one behind the other, by rank.
template <class T>
std::vector<T> gather_all(Team& team, const std::vector<T>& mine) {
    return detail::join<T>(team.gather(detail::as_bytes(mine)));
}

/// What every member gave this one, one behind the other, by rank; to[r] goes to member r.
template <class T>
std::vector<T> exchange_all(Team& team, const std::vector<std::vector<T>>& to) {
    std::vector<std::vector<char>> bytes;
    bytes.reserve(to.size());
    for (const std::vector<T>& records : to) bytes.push_back(detail::as_bytes(records));
    return detail::join<T>(team.exchange(bytes));
}

}  // namespace vdbgeo
