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

    /// Sends floats and returns at once. Messages of one tag from one member to another arrive in their
    /// order.
    virtual void send(int to, int tag, std::vector<float> data) = 0;

    /// A message that is to come. It can begin to come as soon as it is expected.
    class Incoming {
     public:
        virtual ~Incoming() = default;
        /// Waits for it; once.
        virtual std::vector<float> take() = 0;
    };
    virtual std::unique_ptr<Incoming> expect(int from, int tag, std::size_t count) = 0;

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
