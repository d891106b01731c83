// vdbgeo-mpi when a process dies, is interrupted, or finds its disk full.
#include <tuple>

#include "tests/cli/mpi_run.h"

using namespace vdbgeo::test;

#ifdef VDBGEO_MPI_PROGRAM

namespace {

namespace fs = std::filesystem;

int count_of(const std::string& text, const std::string& words) {
    int count = 0;
    for (std::size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++count;
    return count;
}

class MpiFaults : public MpiCli {
 protected:
    /// vdbgeo-mpi with so many processes; the one of this rank runs these lines of bash before it becomes the
    /// program.
    Ended where(int rank, const std::string& lines, const Words& words, int processes = 2,
                const RunOptions& options = {}) {
        const std::string script =
            make("rank.sh", "if [ \"$OMPI_COMM_WORLD_RANK\" = " + std::to_string(rank) + " ]; then\n" +
                                lines + "\nfi\nexec \"$@\"\n");
        Words all = mpirun(processes);
        all.insert(all.end(), {"/bin/bash", script, VDBGEO_MPI_PROGRAM});
        all.insert(all.end(), words.begin(), words.end());
        all.insert(all.end(), {"-j", "1"});
        const Ended r = run(all, options);
        fs::remove(script);
        return r;
    }

    /// The bytes that a command makes undisturbed, and how long it takes.
    void run_whole(const Words& words) {
        const Ended r = mpi(2, words);
        ASSERT_EQ(r.code, 0) << r.err;
        whole_seconds_ = r.seconds;
        whole_ = read_bytes(words[2]);
        fs::remove(words[2]);
        before_ = listing();
    }

    /// Kills a process at moments spread over the run. What a killed run leaves does not disturb the next
    /// one.
    void kill(const Words& words) {
        run_whole(words);
        const std::string name = fs::path(words[2]).filename();
        constexpr int moments = 8;
        int killed = 0, left = 0;
        for (int i = 0; i < moments; ++i) {
            const int rank = i % 2;
            const double moment = whole_seconds_ * (i + 0.5) / moments;
            SCOPED_TRACE(testing::Message()
                         << words[0] << ", process " << rank << " after " << moment << " s");
            // Not if it has ended, and the number is another's.
            const Ended r =
                where(rank,
                      "(sleep " + std::to_string(moment) +
                          "; [ /proc/$$/exe -ef \"$1\" ] && kill -KILL $$) </dev/null >/dev/null 2>&1 &",
                      words);
            EXPECT_LE(count_of(r.err, "vdbgeo-mpi: "), 1) << r.err;
            if (r.code != 0) {
                ++killed;
                EXPECT_FALSE(r.killed) << "mpirun hung";
                EXPECT_EQ(count_of(r.err, "terminate called"), 0) << r.err;
            }
            if (fs::exists(words[2]))
                EXPECT_TRUE(read_bytes(words[2]) == whole_) << "a part of the file was left";
            else
                EXPECT_NE(r.code, 0);
            fs::remove(words[2]);
            for (const std::string& file : listing())
                if (before_.count(file) == 0) {
                    ++left;
                    EXPECT_EQ(file.rfind(name + ".", 0), 0u) << file << " was left";
                }
        }
        EXPECT_GT(killed, moments / 3);
        RecordProperty("left", left);
        EXPECT_EQ(mpi(2, words).code, 0);
        EXPECT_TRUE(read_bytes(words[2]) == whole_);
        fs::remove(words[2]);
        EXPECT_EQ(listing(), before_);
    }

    /// A process that cannot write a file longer than so many KiB: what is there before is there afterwards.
    void fill_disk(int rank, int limit_KiB, const Words& words) {
        SCOPED_TRACE(joined(words) + ", process " + std::to_string(rank));
        const auto before = listing();
        const Ended r =
            where(rank, "trap '' XFSZ; ulimit -f " + std::to_string(limit_KiB) + " || exit 9", words);
        EXPECT_EQ(r.code, 4) << r.err;
        EXPECT_EQ(count_of(r.err, "vdbgeo-mpi: "), 1) << r.err;
        EXPECT_EQ(count_of(r.err, "vdbgeo-mpi: error: " + at("")), 1) << r.err;
        EXPECT_NE(r.err.find("File too large"), std::string::npos) << r.err;
        EXPECT_EQ(listing(), before);
    }

    std::string whole_;
    std::set<std::string> before_;
    double whole_seconds_ = 0;
};

}  // namespace

TEST_F(MpiFaults, AProcessThatIsKilledEndsADenoising) {
    kill({"denoise", noisy(), at("b.mrc"), "--order", "1", "--steps", "60", "--quiet"});
}

TEST_F(MpiFaults, AProcessThatIsKilledEndsASurface) {
    kill({"surface", noisy(), at("b.ply"), "--iso", "0.5sigma", "--quiet"});
}

TEST_F(MpiFaults, ADiskThatIsFullLeavesNothing) {
    const std::string map = noisy();  // 16 MB, of which the first process has 13
    const auto denoise = [&](const std::string& out) {
        return Words{"denoise", map, at(out),         "--order", "0",
                     "--steps", "2", "--compression", "none",    "--quiet"};
    };
    constexpr int less_than_a_part = 2 << 10, less_than_all = 15000;
    make("b.mrc", "old");
    for (const int rank : {0, 1}) fill_disk(rank, less_than_a_part, denoise("b.mrc"));
    fill_disk(0, less_than_all, denoise("b.mrc"));
    EXPECT_EQ(bytes("b.mrc"), "old");
    fill_disk(0, less_than_all, denoise("b.vdb"));
    fill_disk(1, less_than_a_part, denoise("b.parts"));
    make("b.ply", "old");
    for (const int rank : {0, 1})
        fill_disk(rank, less_than_a_part, {"surface", map, at("b.ply"), "--iso", "0.5sigma", "--quiet"});
    EXPECT_EQ(bytes("b.ply"), "old");
}

TEST_F(MpiFaults, InterruptedItSaysSoOnce) {
    const std::string map = noisy();
    const auto before = listing();
    for (const auto& [name, order, signal] :
         {std::tuple("b.mrc", "1", SIGUSR1), {"b.parts", "2", SIGUSR1}, {"b.vdb", "0", SIGTERM}}) {
        Words all = mpirun(3);
        const Words words{VDBGEO_MPI_PROGRAM, "denoise", map,  at(name), "--order", order,
                          "--steps",          "5000",    "-j", "1"};
        all.insert(all.end(), words.begin(), words.end());
        RunOptions options;
        options.signal = signal;
        options.signal_at = "reading";  // that is done: it denoises
        const Ended r = run(all, options);
        // On SIGTERM mpirun kills who has not ended within a second; SIGUSR1 it passes on.
        if (signal == SIGUSR1) {
            EXPECT_EQ(r.code, 130) << r.err;
            EXPECT_EQ(count_of(r.err, "vdbgeo-mpi: error: interrupted\n"), 1) << r.err;
        }
        EXPECT_NE(r.code, 0);
        EXPECT_LE(count_of(r.err, "vdbgeo-mpi: "), 1) << r.err;
        EXPECT_EQ(listing(), before);
    }
}

#endif
