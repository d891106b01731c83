// A team of threads: what several processes do, in one.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <tuple>
#include <vector>

#include "vdbgeo/core/team.h"

namespace vdbgeo::test {

/// Runs body(team) for each of `size` members, each in a thread. What a member throws is thrown again once
/// all have ended; so a member must not throw alone.
class ThreadTeam {
 public:
    explicit ThreadTeam(int size) : size_(size) {}

    void run(const std::function<void(Team&)>& body) {
        std::vector<std::thread> threads;
        std::vector<std::exception_ptr> failures(static_cast<std::size_t>(size_));
        for (int r = 0; r < size_; ++r)
            threads.emplace_back([&, r] {
                Member member(*this, r);
                try {
                    body(member);
                } catch (...) {
                    failures[static_cast<std::size_t>(r)] = std::current_exception();
                }
            });
        for (std::thread& t : threads) t.join();
        for (const std::exception_ptr& e : failures)
            if (e) std::rethrow_exception(e);
    }

 private:
    using Key = std::tuple<int, int, int>;  // from, to, tag

    class Member : public Team {
     public:
        Member(ThreadTeam& team, int rank) : team_(team), rank_(rank) {}
        int size() const override { return team_.size_; }
        int rank() const override { return rank_; }

        std::vector<std::vector<char>> gather(const std::vector<char>& mine) override {
            std::unique_lock<std::mutex> lock(team_.mutex_);
            team_.given_.resize(static_cast<std::size_t>(team_.size_));
            team_.given_[static_cast<std::size_t>(rank_)] = mine;
            const int round = team_.round_;
            if (++team_.arrived_ == team_.size_) {
                team_.arrived_ = 0;
                ++team_.round_;
                team_.all_ = team_.given_;
                team_.changed_.notify_all();
            }
            team_.changed_.wait(lock, [&] { return team_.round_ != round; });
            return team_.all_;
        }
        std::vector<std::vector<char>> exchange(const std::vector<std::vector<char>>& to) override {
            const auto me = static_cast<std::size_t>(rank_);
            {
                const std::lock_guard<std::mutex> lock(team_.mutex_);
                team_.letters_.resize(static_cast<std::size_t>(team_.size_));
                team_.letters_[me] = to;
            }
            gather({});  // all have given
            std::vector<std::vector<char>> mine;
            {
                const std::lock_guard<std::mutex> lock(team_.mutex_);
                for (const auto& from : team_.letters_) mine.push_back(from[me]);
            }
            gather({});  // all have taken
            return mine;
        }
        void add_up(std::vector<std::uint64_t>& numbers) override {
            const std::vector<std::uint64_t> all = gather_all(*this, numbers);
            const std::size_t n = numbers.size();
            for (std::size_t i = 0; i < n; ++i) {
                numbers[i] = 0;
                for (std::size_t k = i; k < all.size(); k += n) numbers[i] += all[k];
            }
        }
        std::unique_ptr<Outgoing> outgoing(int to, int tag) override {
            return std::make_unique<Sender>(team_, Key{rank_, to, tag});
        }
        std::unique_ptr<Incoming> incoming(int from, int tag) override {
            return std::make_unique<Receiver>(team_, Key{from, rank_, tag});
        }

     private:
        ThreadTeam& team_;
        int rank_;
    };

    class Sender : public Team::Outgoing {
     public:
        Sender(ThreadTeam& team, Key key) : team_(team), key_(key) {}
        float* buffer(std::size_t count) override {
            letter_.resize(count);
            return letter_.data();
        }
        void send() override {
            const std::lock_guard<std::mutex> lock(team_.mutex_);
            team_.mail_[key_].push_back(letter_);
            team_.changed_.notify_all();
        }

     private:
        ThreadTeam& team_;
        Key key_;
        std::vector<float> letter_;
    };

    class Receiver : public Team::Incoming {
     public:
        Receiver(ThreadTeam& team, Key key) : team_(team), key_(key) {}
        void expect(std::size_t count) override { count_ = count; }
        const float* take() override {
            std::unique_lock<std::mutex> lock(team_.mutex_);
            auto& letters = team_.mail_[key_];
            team_.changed_.wait(lock, [&] { return !letters.empty(); });
            letter_ = std::move(letters.front());
            letters.pop_front();
            if (letter_.size() != count_) throw std::logic_error("a message of another length was expected");
            return letter_.data();
        }

     private:
        ThreadTeam& team_;
        Key key_;
        std::size_t count_ = 0;
        std::vector<float> letter_;
    };

    int size_, arrived_ = 0, round_ = 0;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::vector<std::vector<char>> given_, all_;
    std::vector<std::vector<std::vector<char>>> letters_;
    std::map<Key, std::deque<std::vector<float>>> mail_;
};

}  // namespace vdbgeo::test
