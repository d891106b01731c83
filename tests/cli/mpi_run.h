// vdbgeo-mpi under mpirun, for the tests that need it.
#pragma once

#include "tests/cli/cli_test.h"

#ifdef VDBGEO_MPI_PROGRAM

namespace vdbgeo::test {

class MpiCli : public Cli {
 protected:
    void SetUp() override {
        if (sanitized) GTEST_SKIP() << "NOT TESTED: mpirun and sanitizers do not go together";
        const Ended probe = mpi(2, {"denoise", "--help"}, 1, std::chrono::seconds(30));
        if (probe.code != 0) GTEST_SKIP() << "NOT TESTED: mpirun starts no processes here: " << probe.err;
    }

    /// mpirun, as what comes before the command that it starts so many times.
    static Words mpirun(int processes) {
        return {MPIRUN_PROGRAM, "-q", "--allow-run-as-root",    "--oversubscribe", "--bind-to",
                "none",         "-n", std::to_string(processes)};
    }

    /// mpirun with so many processes of so many threads.
    static Ended mpi(int processes, const Words& words, int threads = 1,
                     std::chrono::seconds patience = std::chrono::seconds(240)) {
        Words all = mpirun(processes);
        all.push_back(VDBGEO_MPI_PROGRAM);
        all.insert(all.end(), words.begin(), words.end());
        all.insert(all.end(), {"-j", std::to_string(threads)});
        RunOptions options;
        options.give_up = patience;
        return run(all, options);
    }

    /// A noisy map of five by two cells.
    std::string noisy() { return phantom("a.mrc", 160, {"--snr", "0.5"}, "atpase"); }
};

}  // namespace vdbgeo::test

#endif
