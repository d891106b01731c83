// Runs that were killed go on from their checkpoint, and end with the bytes of one that was not.
#include <thread>

#include "tests/cli/cli_test.h"

using namespace vdbgeo::test;

namespace {

namespace fs = std::filesystem;

class Checkpoints : public Cli {
 protected:
    void SetUp() override { map_ = phantom("a.mrc", 96, {"--snr", "0.5"}, "atpase"); }

    /// Ten cycles.
    Words words(const std::string& out, const Words& more = {}) const {
        Words all{"denoise", map_, at(out), "--order", "1", "--steps", "80", "--cycle", "8", "--quiet"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    Words resuming(const std::string& out) const {
        return words(out, {"--checkpoint", at("c"), "--resume", "--json"});
    }
    /// Too many cycles for a test to see the end.
    Words lasting(const std::string& out) const {
        return {"denoise", map_, at(out), "--order", "1", "--steps", "80000", "--cycle", "8", "--quiet",
                "--checkpoint", at("c"), "--checkpoint-every", "20"};
    }
    /// That run, sent a signal once its first checkpoint is there.
    Ended terminated(const std::string& out, int signal) const {
        RunOptions options;
        options.signal = signal;
        options.signal_by_file = at("c/b/list");
        return vdbgeo(lasting(out), options);
    }
    /// How many lines of a file start so.
    std::size_t count(const std::string& file, const std::string& start) const {
        std::ifstream in(at(file));
        std::size_t n = 0;
        for (std::string line; std::getline(in, line);) n += line.rfind(start, 0) == 0;
        return n;
    }
    std::string expected() const {
        good(words("whole.mrc"));
        return bytes("whole.mrc");
    }

    std::string map_;
};

}  // namespace

TEST_F(Checkpoints, KilledAtAnyMomentItGoesOn) {
    const std::string whole = expected();
    const double all = good(words("b.mrc", {"--checkpoint", at("c")})).seconds;
    EXPECT_TRUE(bytes("b.mrc") == whole);
    EXPECT_FALSE(fs::exists(at("c")));  // nothing is left to resume
    int killed = 0, resumed = 0;
    for (int i = 0; i < 10; ++i) {
        fs::remove(at("b.mrc"));
        RunOptions options;
        // Moments that repeat, all over the run.
        options.signal_after =
            std::chrono::milliseconds(static_cast<int>(1000 * all * ((i * 7 + 3) % 20) / 20));
        const Ended r = vdbgeo(words("b.mrc", {"--checkpoint", at("c"), "--resume"}), options);
        killed += r.killed == SIGKILL;
        if (fs::exists(at("b.mrc"))) {
            EXPECT_TRUE(bytes("b.mrc") == whole);
        }
        if (i % 2) continue;  // some are killed twice before they go on
        const Ended end = good(resuming("b.mrc"));
        const Json told = Json::parse(end.out, nullptr, false);
        ASSERT_TRUE(told.is_object());
        resumed += told["resumed_cycles"] > 0;
        EXPECT_TRUE(bytes("b.mrc") == whole) << i;
    }
    EXPECT_GT(killed, 3);
    EXPECT_GT(resumed, 0);
}

TEST_F(Checkpoints, ATerminatedRunWritesOneFirst) {
    for (const int signal : {SIGTERM, SIGUSR1}) {
        const Ended r = terminated("b.mrc", signal);
        EXPECT_EQ(r.code, 130);
        EXPECT_NE(r.err.find(at("c") + ": a checkpoint is written"), std::string::npos) << r.err;
        // The first was due after 20 cycles; this one was not due.
        EXPECT_LT(count("c/a/list", "cycle "), 40u);
        EXPECT_GT(count("c/a/list", "cycle "), 20u);
        EXPECT_FALSE(fs::exists(at("b.mrc")));
        fs::remove_all(at("c"));
    }
}

TEST_F(Checkpoints, OfAnotherMapOrOtherOptionsIsRefused) {
    EXPECT_EQ(terminated("b.mrc", SIGTERM).code, 130);
    expect_error(vdbgeo(words("b.mrc", {"--checkpoint", at("c"), "--resume"})), 3, map_,
                 "another map or of other options");
    const std::string other = phantom("o.mrc", 96, {"--snr", "0.4"}, "atpase");
    Words of_other = lasting("b.mrc");
    of_other[1] = other;
    of_other.push_back("--resume");
    expect_error(vdbgeo(of_other), 3, other, "another map or of other options");
    expect_error(vdbgeo(words("b.mrc", {"--resume"})), 2, "--resume needs --checkpoint");
    expect_error(vdbgeo({"denoise", map_, at("b.mrc"), "--method", "median", "--checkpoint", at("c")}), 2,
                 "--checkpoint means nothing to --method median");
    expect_error(vdbgeo(words("b.mrc", {"--checkpoint", "/proc/none"})), 4, "/proc/none");
    EXPECT_FALSE(fs::exists(at("b.mrc")));
}

TEST_F(Checkpoints, AFullDiskEndsTheRun) {
    RunOptions options;
    options.limits = {{RLIMIT_FSIZE, 1000000}};
    expect_error(vdbgeo(words("b.mrc", {"--checkpoint", at("c")}), options), 4, at("c"), "cannot be written");
    EXPECT_FALSE(fs::exists(at("b.mrc")));
}

#ifdef VDBGEO_MPI_PROGRAM

namespace {

class MpiCheckpoints : public Checkpoints {
 protected:
    void SetUp() override {
        if (sanitized) GTEST_SKIP() << "NOT TESTED: mpirun and sanitizers do not go together";
        const Ended probe = shell(mpirun(2, {"denoise", "--help"}));
        if (probe.code != 0) GTEST_SKIP() << "NOT TESTED: mpirun starts no processes here: " << probe.err;
        Checkpoints::SetUp();
    }
    static std::string mpirun(int processes, const Words& words) {
        return std::string(MPIRUN_PROGRAM) + " -q --allow-run-as-root --oversubscribe --bind-to none -n " +
               std::to_string(processes) + " " + VDBGEO_MPI_PROGRAM + " " + joined(words) + " -j 1";
    }
    static Ended shell(const std::string& line) { return run({"/bin/bash", "-c", line}); }
};

}  // namespace

TEST_F(MpiCheckpoints, AProcessThatIsKilledTakesAllDownAndTheRestGoesOnWithFewer) {
    const std::string whole = expected();
    const Words how = words("b.mrc", {"--checkpoint", at("c"), "--resume"});
    const double all = shell(mpirun(3, words("b.mrc"))).seconds;
    int killed = 0;
    for (int i = 0; i < 10; ++i) {
        fs::remove(at("b.mrc"));
        const double moment = all * ((i * 7 + 3) % 20) / 20;
        const Ended r = shell(mpirun(3, how) + " & p=$!; sleep " + std::to_string(moment) +
                              "; kill -9 $(pgrep -P $p | sed -n " + std::to_string(i % 3 + 1) +
                              "p) 2>/dev/null; wait $p");
        killed += r.code != 0;
        // Killed behind its last step, it is there and whole.
        if (fs::exists(at("b.mrc"))) {
            EXPECT_TRUE(bytes("b.mrc") == whole);
        }
        if (i % 2) continue;
        if (i % 4)
            good(resuming("b.mrc"));
        else
            EXPECT_EQ(shell(mpirun(2, how)).code, 0);
        EXPECT_TRUE(bytes("b.mrc") == whole) << i;
    }
    EXPECT_GT(killed, 3);
}

#endif
