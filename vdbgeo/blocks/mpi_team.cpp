#include "vdbgeo/blocks/mpi_team.h"

#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <climits>
#include <cstdlib>
#include <exception>
#include <memory>
#include <thread>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

/// MPI counts in int: what is longer goes in pieces.
constexpr std::size_t piece = std::size_t(1) << 30;

int count_of(std::size_t n) {
    if (n > INT_MAX) throw InvalidInput("a message of more than 2^31 numbers: use more, smaller parts");
    return static_cast<int>(n);
}

/// One end of a line, with the memory of its messages.
class Line {
 public:
    Line(int member, int tag) : member_(member), tag_(tag) {}
    Line(const Line&) = delete;
    Line& operator=(const Line&) = delete;

 protected:
    ~Line() {
        if (request_ == MPI_REQUEST_NULL) return;
        // Who gives up waits for nobody.
        if (std::uncaught_exceptions() == 0) {
            wait();
            return;
        }
        int done = 0;
        MPI_Test(&request_, &done, MPI_STATUS_IGNORE);
        if (done) return;
        MPI_Request_free(&request_);
        // It may be on its way, and move while those that gave up meet: its place has to stay.
        static_cast<void>(data_.release());
    }
    void wait() { MPI_Wait(&request_, MPI_STATUS_IGNORE); }
    /// Not initialised.
    void make_room(std::size_t count) {
        if (count > room_) data_.reset(new float[count]);
        room_ = std::max(room_, count);
        count_ = count;
    }

    int member_, tag_;
    std::size_t room_ = 0, count_ = 0;
    std::unique_ptr<float[]> data_;
    MPI_Request request_ = MPI_REQUEST_NULL;
};

class Sender : public Team::Outgoing, Line {
 public:
    using Line::Line;
    float* buffer(std::size_t count) override {
        wait();
        make_room(count);
        return data_.get();
    }
    void send() override {
        MPI_Isend(data_.get(), count_of(count_), MPI_FLOAT, member_, tag_, MPI_COMM_WORLD, &request_);
    }
};

class Receiver : public Team::Incoming, Line {
 public:
    using Line::Line;
    ~Receiver() override {
        if (request_ != MPI_REQUEST_NULL) MPI_Cancel(&request_);
    }
    void expect(std::size_t count) override {
        make_room(count);
        MPI_Irecv(data_.get(), count_of(count), MPI_FLOAT, member_, tag_, MPI_COMM_WORLD, &request_);
    }
    const float* take() override {
        wait();
        return data_.get();
    }
};

}  // namespace

class MpiRun::Members : public Team {
 public:
    Members() {
        MPI_Comm_size(MPI_COMM_WORLD, &size_);
        MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
        MPI_Comm_dup(MPI_COMM_WORLD, &failing);
        MPI_Comm_set_errhandler(failing, MPI_ERRORS_RETURN);  // others may be gone
        MPI_Comm_dup(MPI_COMM_WORLD, &untagged);
    }
    ~Members() override {
        if (gave_up) return;
        MPI_Comm_free(&failing);
        MPI_Comm_free(&untagged);
    }

    static constexpr auto patience = std::chrono::seconds(2);

    MPI_Comm failing = MPI_COMM_NULL;   ///< where those meet that give up, whatever goes on elsewhere
    MPI_Comm untagged = MPI_COMM_NULL;  ///< for the messages of exchange
    bool gave_up = false;

    int size() const override { return size_; }
    int rank() const override { return rank_; }

    std::vector<std::vector<char>> gather(const std::vector<char>& mine) override {
        const std::uint64_t own = mine.size();
        std::vector<std::uint64_t> sizes(static_cast<std::size_t>(size_));
        MPI_Allgather(&own, 1, MPI_UINT64_T, sizes.data(), 1, MPI_UINT64_T, MPI_COMM_WORLD);
        std::vector<std::vector<char>> all(static_cast<std::size_t>(size_));
        for (int r = 0; r < size_; ++r) {
            std::vector<char>& part = all[static_cast<std::size_t>(r)];
            part.resize(sizes[static_cast<std::size_t>(r)]);
            if (r == rank_) std::copy(mine.begin(), mine.end(), part.begin());
            for (std::size_t at = 0; at < part.size(); at += piece)
                MPI_Bcast(part.data() + at, count_of(std::min(piece, part.size() - at)), MPI_BYTE, r,
                          MPI_COMM_WORLD);
        }
        return all;
    }

    std::vector<std::vector<char>> exchange(const std::vector<std::vector<char>>& to) override {
        const auto n = static_cast<std::size_t>(size_);
        std::vector<std::uint64_t> give(n), take(n);
        for (std::size_t r = 0; r < n; ++r) give[r] = to[r].size();
        MPI_Alltoall(give.data(), 1, MPI_UINT64_T, take.data(), 1, MPI_UINT64_T, MPI_COMM_WORLD);
        std::vector<std::vector<char>> from(n);
        std::vector<MPI_Request> requests;
        const auto for_pieces = [&](std::uint64_t bytes, const auto& body) {
            for (std::uint64_t at = 0; at < bytes; at += piece) {
                requests.push_back(MPI_REQUEST_NULL);
                body(at, count_of(std::min<std::uint64_t>(piece, bytes - at)), &requests.back());
            }
        };
        for (std::size_t r = 0; r < n; ++r) {
            from[r].resize(take[r]);
            for_pieces(take[r], [&](std::uint64_t at, int count, MPI_Request* request) {
                MPI_Irecv(from[r].data() + at, count, MPI_BYTE, static_cast<int>(r), 0, untagged, request);
            });
        }
        for (std::size_t r = 0; r < n; ++r)
            for_pieces(give[r], [&](std::uint64_t at, int count, MPI_Request* request) {
                MPI_Isend(to[r].data() + at, count, MPI_BYTE, static_cast<int>(r), 0, untagged, request);
            });
        MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
        return from;
    }

    void rest_until_all_come() override {
        MPI_Request request = MPI_REQUEST_NULL;
        MPI_Ibarrier(MPI_COMM_WORLD, &request);
        for (int done = 0; !done; MPI_Test(&request, &done, MPI_STATUS_IGNORE))
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }

    void add_up(std::vector<std::uint64_t>& numbers) override {
        MPI_Allreduce(MPI_IN_PLACE, numbers.data(), count_of(numbers.size()), MPI_UINT64_T, MPI_SUM,
                      MPI_COMM_WORLD);
    }

    std::unique_ptr<Outgoing> outgoing(int to, int tag) override { return std::make_unique<Sender>(to, tag); }
    std::unique_ptr<Incoming> incoming(int from, int tag) override {
        return std::make_unique<Receiver>(from, tag);
    }

    void move_messages() override {
        int there = 0;
        MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, failing, &there, MPI_STATUS_IGNORE);
    }

    /// Tells all others that this one failed. Returns who did, once all have or there was time enough.
    std::vector<bool> meet_those_that_failed() {
        using Clock = std::chrono::steady_clock;
        std::vector<MPI_Request> told;
        for (int r = 0; r < size_; ++r) {
            if (r == rank_) continue;
            told.push_back(MPI_REQUEST_NULL);
            MPI_Isend(nullptr, 0, MPI_BYTE, r, 0, failing, &told.back());
        }
        std::vector<bool> failed(static_cast<std::size_t>(size_));
        failed[static_cast<std::size_t>(rank_)] = true;
        int alive = size_ - 1;
        for (const auto begin = Clock::now(); alive > 0 && Clock::now() - begin < patience;) {
            int there = 0;
            MPI_Status status;
            MPI_Iprobe(MPI_ANY_SOURCE, 0, failing, &there, &status);
            if (!there) {
                std::this_thread::sleep_for(std::chrono::milliseconds(5));
                continue;
            }
            MPI_Recv(nullptr, 0, MPI_BYTE, status.MPI_SOURCE, 0, failing, MPI_STATUS_IGNORE);
            failed[static_cast<std::size_t>(status.MPI_SOURCE)] = true;
            --alive;
        }
        if (alive == 0) MPI_Waitall(static_cast<int>(told.size()), told.data(), MPI_STATUSES_IGNORE);
        return failed;
    }

 private:
    int size_ = 1, rank_ = 0;
};

MpiRun::MpiRun(int& argc, char**& argv) {
    int provided = 0;
    // Where processes of one machine cannot read each other's memory, Open MPI moves large messages in pieces
    // of 32 kB, some at a time, and only while both are in MPI: with the default two processes took 3.5
    // to 4.4 s for what takes 3.5 s in pieces of this size. Who sets it otherwise, or another MPI, is left
    // alone.
    ::setenv("OMPI_MCA_btl_vader_max_send_size", "1048576", 0);
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
    members_ = std::make_unique<Members>();
}

MpiRun::~MpiRun() {
    members_.reset();
    MPI_Finalize();
}

Team& MpiRun::team() { return *members_; }

void MpiRun::fail(int code, const std::function<void()>& say) {
    members_->gave_up = true;
    const std::vector<bool> failed = members_->meet_those_that_failed();
    const auto first = std::find(failed.begin(), failed.end(), true) - failed.begin();
    if (first == members_->rank()) say();
    if (std::count(failed.begin(), failed.end(), false) == 0) return;
    // The first has to have its say before somebody ends the run.
    if (first != members_->rank()) std::this_thread::sleep_for(Members::patience);
    MPI_Abort(MPI_COMM_WORLD, code);
    std::abort();
}

}  // namespace vdbgeo
