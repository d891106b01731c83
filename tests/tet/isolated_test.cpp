// A foreign library's crashes, endless loops and appetite stay in the process that was made for them.
#include "vdbgeo/tet/isolated.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <thread>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using Bytes = std::vector<std::byte>;

Bytes bytes_of(std::size_t n, unsigned seed) {
    Bytes bytes(n);
    for (std::size_t i = 0; i < n; ++i) bytes[i] = std::byte((i * 2654435761u + seed) >> 7 & 255);
    return bytes;
}

template <class E>
std::string message_of(const std::function<Bytes()>& work, const IsolationLimits& limits = {},
                       const Progress& progress = {}) {
    try {
        run_isolated(work, limits, "library", progress);
    } catch (const E& e) {
        return e.what();
    } catch (const std::exception& e) {
        return std::string("another error: ") + e.what();
    }
    return "no error";
}

bool has_no_children() {
    const pid_t pid = waitpid(-1, nullptr, WNOHANG);
    return pid < 0 && errno == ECHILD;
}

[[noreturn]] void loop_for_ever() {
    for (volatile unsigned i = 0;;) i = i + 1;
}

TEST(Isolated, GivesTheBytes) {
    for (const std::size_t n :
         {std::size_t(0), std::size_t(1), std::size_t(100'000), std::size_t(200'000'000)})
        EXPECT_TRUE(run_isolated([n] { return bytes_of(n, 5); }, {}, "library") == bytes_of(n, 5)) << n;
    EXPECT_TRUE(has_no_children());
}

TEST(Isolated, LeavesTheParentAsItWas) {
    int touched = 0;
    const Bytes got = run_isolated(
        [&] {
            touched = 1;
            return Bytes(1, std::byte(7));
        },
        {}, "library");
    EXPECT_EQ(got, Bytes(1, std::byte(7)));
    EXPECT_EQ(touched, 0);
}

TEST(Isolated, NamesTheSignalOfACrash) {
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes {
                  raise(SIGSEGV);
                  return {};
              }),
              "library: crashed (SIGSEGV)");
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes { std::abort(); }), "library: crashed (SIGABRT)");
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes {
                  raise(SIGKILL);
                  return {};
              }),
              "library: killed (SIGKILL); the machine may have run out of memory");
    EXPECT_TRUE(has_no_children());
}

TEST(Isolated, NoticesAnExit) {
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes { _exit(9); }),
              "library: ended without a result (exit code 9)");
}

TEST(Isolated, PassesErrorsOnByWhoseFaultTheyAre) {
    EXPECT_EQ(message_of<InvalidInput>([]() -> Bytes { throw InvalidInput("a bad face"); }),
              "library: a bad face");
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes { throw NumericalError("gave up"); }),
              "library: gave up");
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes { throw std::out_of_range("no such thing"); }),
              "library: no such thing");
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes { throw 42; }), "library: failed without saying why");
}

TEST(Isolated, StopsAtTheTimeLimit) {
    IsolationLimits limits;
    limits.max_seconds = 0.3;
    EXPECT_EQ(message_of<NumericalError>([]() -> Bytes { loop_for_ever(); }, limits),
              "library: stopped after 0.3 s, its limit");
    EXPECT_TRUE(has_no_children());
}

TEST(Isolated, StopsAtTheMemoryLimit) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers reserve more address space than any limit";
#endif
    IsolationLimits limits;
    limits.max_bytes = 100'000'000;
    EXPECT_EQ(message_of<NumericalError>(
                  []() -> Bytes {
                      std::vector<Bytes> hoard;
                      for (;;) hoard.emplace_back(10'000'000, std::byte(1));
                  },
                  limits),
              "library: out of memory: it may take 100 MB");
    EXPECT_EQ(run_isolated([] { return Bytes(40'000'000); }, limits, "library").size(), 40'000'000u);
}

TEST(Isolated, IsCancelledWithinAMoment) {
    const auto start = std::chrono::steady_clock::now();
    int asked = 0;
    const Progress stop_at_third([&](double) { return ++asked < 3; });
    EXPECT_EQ(message_of<Cancelled>([]() -> Bytes { loop_for_ever(); }, {}, stop_at_third), "interrupted");
    EXPECT_TRUE(has_no_children());
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
}

TEST(Isolated, KeepsChatterAway) {
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    std::printf("before;");
    run_isolated(
        [] {
            for (int i = 0; i < 10'000; ++i) std::printf("chatter");
            std::fprintf(stderr, "complaint");
            std::fflush(nullptr);
            return Bytes();
        },
        {}, "library");
    std::printf("after;");
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "before;after;");
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Isolated, TerminalSignalsAreTheParentsToAnswer) {
    const Bytes got = run_isolated(
        [] {
            for (const int s : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) raise(s);
            return Bytes(1, std::byte(1));
        },
        {}, "library");
    EXPECT_EQ(got.size(), 1u);
}

TEST(Isolated, SeveralAtOnceFromWorkerThreads) {
    std::vector<Bytes> results(12);
    parallel_for(results.size(), 1, [&](std::size_t i) {
        results[i] = run_isolated([i] { return bytes_of(300'000 + i, unsigned(i)); }, {}, "library");
    });
    for (std::size_t i = 0; i < results.size(); ++i)
        EXPECT_TRUE(results[i] == bytes_of(300'000 + i, unsigned(i))) << i;
    EXPECT_TRUE(has_no_children());
}

/// Other threads allocate and throw without pause while children are made that allocate and throw too.
TEST(Isolated, WorksWhileOtherThreadsAreBusy) {
    std::atomic<bool> stop{false};
    std::vector<std::thread> busy;
    for (int t = 0; t < 3; ++t)
        busy.emplace_back([&] {
            while (!stop) try {
                    std::vector<int> some(1000, 1);
                    throw std::runtime_error(std::to_string(std::accumulate(some.begin(), some.end(), 0)));
                } catch (const std::exception&) {
                }
        });
    IsolationLimits limits;
    limits.max_seconds = 60;
    for (int i = 0; i < 100; ++i)
        EXPECT_EQ(message_of<InvalidInput>(
                      []() -> Bytes {
                          const Bytes some = bytes_of(10'000, 1);
                          throw InvalidInput(std::to_string(some.size()));
                      },
                      limits),
                  "library: 10000");
    stop = true;
    for (std::thread& t : busy) t.join();
}

/// A process that dies takes its child with it.
TEST(Isolated, TheChildDiesWithTheParent) {
    ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);  // the orphan becomes ours to wait for
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t parent = fork();
    if (parent == 0) {
        int asked = 0;
        const Progress tell_when_running([&](double) {
            if (++asked == 3 && write(ends[1], "x", 1) != 1) _exit(1);
            return true;
        });
        message_of<NumericalError>([]() -> Bytes { loop_for_ever(); }, {}, tell_when_running);
        _exit(0);
    }
    char c = 0;
    ASSERT_EQ(read(ends[0], &c, 1), 1);
    kill(parent, SIGKILL);
    ASSERT_EQ(waitpid(parent, nullptr, 0), parent);
    int status = 0;
    EXPECT_GT(waitpid(-1, &status, 0), 0);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    prctl(PR_SET_CHILD_SUBREAPER, 0);
    for (const int end : ends) close(end);
}

}  // namespace
}  // namespace vdbgeo
