// The scripts for clusters, as Slurm runs them: its variables are set, and srun, scancel and scontrol are
// stubs that do on this machine what theirs do.
#include <cstdlib>

#include "tests/cli/mpi_run.h"

using namespace vdbgeo::test;

namespace {

namespace fs = std::filesystem;

const std::string scripts = std::string(VDBGEO_SOURCE_FOLDER) + "/scripts/";

std::string search_path() {
    const char* path = std::getenv("PATH");
    return path ? path : "/usr/bin:/bin";
}

bool have(const std::string& program) { return run({"/bin/sh", "-c", "command -v " + program}).code == 0; }

/// bash with a script and these variables.
Ended job(const std::string& script, Words variables, const RunOptions& options = {}) {
    variables.insert(variables.begin(), "/usr/bin/env");
    variables.insert(variables.end(), {"/bin/bash", scripts + script});
    return run(variables, options);
}

}  // namespace

TEST(Scripts, ShellcheckFindsNothing) {
    if (!have("shellcheck")) GTEST_SKIP() << "NOT TESTED: shellcheck is not installed";
    const Ended r =
        run({"/usr/bin/env", "shellcheck", scripts + "slurm/tomogram.sbatch", scripts + "slurm/maps.sbatch"});
    EXPECT_EQ(r.code, 0) << r.out;
}

#ifdef VDBGEO_MPI_PROGRAM

namespace {

/// The job of one tomogram. What the stubs are asked stands in the file `asked`.
class TomogramJob : public MpiCli {
 protected:
    void SetUp() override {
        MpiCli::SetUp();
        if (IsSkipped()) return;
        fs::create_directory(folder_ / "bin");
        // As srun does, mpirun passes SIGUSR1 on to the processes.
        stub("srun", "while [ \"${1#-}\" != \"$1\" ]; do shift; done\nexec " + joined(mpirun(2)) + "\"$@\"");
        stub("scontrol", ":");
    }

    void stub(const std::string& name, const std::string& lines) const {
        make("bin/" + name, "#!/bin/sh\necho \"" + name + " $*\" >>'" + at("asked") + "'\n" + lines + "\n");
        fs::permissions(folder_ / "bin" / name, fs::perms(0755));
    }

    std::string asked() {
        const std::string text = bytes("asked");
        fs::remove(folder_ / "asked");
        return text;
    }

    Ended tomogram(Words variables, const RunOptions& options = {}) const {
        const Words all{"PATH=" + at("bin") + ":" + search_path(),
                        "VDBGEO_MPI=" + std::string(VDBGEO_MPI_PROGRAM), "OUT=" + at("out"), "SLURM_JOB_ID=7",
                        "SLURM_CPUS_PER_TASK=1"};
        variables.insert(variables.begin(), all.begin(), all.end());
        return job("slurm/tomogram.sbatch", variables, options);
    }

    /// Slurm's warning, once the map was read.
    static RunOptions time_is_up() {
        RunOptions options;
        options.signal = SIGUSR1;
        options.signal_at = "reading";
        return options;
    }
};

}  // namespace

TEST_F(TomogramJob, SmoothsAndExtractsOnce) {
    const std::string map = noisy();
    const Words variables{"MAP=" + map, "ISO=1sigma", "DENOISE=--order 0 --steps 6", "READ=--bin 2"};
    Ended r = tomogram(variables);
    EXPECT_EQ(r.code, 0) << r.err;
    std::string text = asked();
    EXPECT_EQ(text.rfind("srun --cpu-bind=cores --kill-on-bad-exit=1 ", 0), 0u) << text;
    EXPECT_NE(text.find(" denoise " + map + " " + at("out/smooth.vdb") + " --bin 2 --order 0 --steps 6 "),
              std::string::npos)
        << text;
    EXPECT_EQ(text.find("scontrol"), std::string::npos) << text;
    good({"denoise", map, at("a.vdb"), "--bin", "2", "--order", "0", "--steps", "6", "--quiet"});
    EXPECT_TRUE(bytes("out/smooth.vdb") == bytes("a.vdb"));
    good({"surface", at("a.vdb"), at("a.ply"), "--iso", "1sigma", "--quiet"});
    EXPECT_TRUE(bytes("out/surface.ply") == bytes("a.ply"));
    // Again: nothing is done. With another isovalue: the surface alone; with other flags or another map:
    // both.
    EXPECT_EQ(tomogram(variables).code, 0);
    EXPECT_EQ(asked(), "");
    Words other = variables;
    other[1] = "ISO=2sigma";
    EXPECT_EQ(tomogram(other).code, 0);
    text = asked();
    EXPECT_NE(text.find(" surface "), std::string::npos) << text;
    EXPECT_EQ(text.find(" denoise "), std::string::npos) << text;
    other[2] = "DENOISE=--order 0 --steps 2";
    EXPECT_EQ(tomogram(other).code, 0);
    text = asked();
    EXPECT_NE(text.find(" denoise "), std::string::npos) << text;
    EXPECT_NE(text.find(" surface "), std::string::npos) << text;
    phantom("a.mrc", 160, {"--snr", "2"}, "atpase");
    EXPECT_EQ(tomogram(other).code, 0);
    EXPECT_NE(asked().find(" denoise "), std::string::npos);
}

TEST_F(TomogramJob, GoesOnWhenItsTimeWasUp) {
    const std::string map = noisy();
    const Words variables{"MAP=" + map, "ISO=1sigma", "DENOISE=--order 0 --steps 600"};
    Ended r = tomogram(variables, time_is_up());
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(r.err.find("error: interrupted"), std::string::npos) << r.err;
    EXPECT_NE(r.out.find("goes back into the queue"), std::string::npos) << r.out;
    std::string text = asked();
    EXPECT_NE(text.find("\nscontrol requeue 7\n"), std::string::npos) << text;
    EXPECT_FALSE(fs::exists(folder_ / "out/smooth.vdb"));
    EXPECT_TRUE(fs::exists(folder_ / "out/checkpoint"));
    Words again = variables;
    again.push_back("SLURM_RESTART_COUNT=1");
    r = tomogram(again);
    EXPECT_EQ(r.code, 0) << r.err;
    good({"denoise", map, at("a.vdb"), "--order", "0", "--steps", "600", "--quiet"});
    EXPECT_TRUE(bytes("out/smooth.vdb") == bytes("a.vdb"));
    EXPECT_TRUE(fs::exists(folder_ / "out/surface.ply"));
    EXPECT_EQ(asked().find("scontrol"), std::string::npos);
}

TEST_F(TomogramJob, DoesNotGoOnForEver) {
    const Words variables{"MAP=" + noisy(), "DENOISE=--order 0 --steps 5000", "RESTARTS=2",
                          "SLURM_RESTART_COUNT=2"};
    const Ended r = tomogram(variables, time_is_up());
    EXPECT_EQ(r.code, 1) << r.err;
    EXPECT_NE(r.err.find("not done after 2 restarts"), std::string::npos) << r.err;
    EXPECT_EQ(asked().find("scontrol"), std::string::npos);
}

TEST_F(TomogramJob, WithMpirunInsteadOfSrun) {
    const Words variables{"MAP=" + noisy(), "DENOISE=--order 0 --steps 5000", "LAUNCH=" + joined(mpirun(2))};
    const Ended r = tomogram(variables, time_is_up());
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(r.err.find("error: interrupted"), std::string::npos) << r.err;
    EXPECT_EQ(asked(), "scontrol requeue 7\n");
    EXPECT_TRUE(fs::exists(folder_ / "out/checkpoint"));
}

TEST_F(TomogramJob, FailsWithTheCommandsExitCode) {
    Ended r = tomogram({"MAP=" + at("none.mrc")});
    EXPECT_EQ(r.code, 4) << r.err;
    EXPECT_NE(r.err.find("none.mrc: cannot be opened"), std::string::npos) << r.err;
    r = tomogram({"MAP=" + phantom("a.mrc", 64), "ISO=1e9"});
    EXPECT_EQ(r.code, 5) << r.err;
    EXPECT_EQ(asked().find("scontrol"), std::string::npos);
    r = tomogram({});
    EXPECT_EQ(r.code, 1);
    EXPECT_NE(r.err.find("MAP: the map to read"), std::string::npos) << r.err;
}

#endif

namespace {

/// The job array of many maps.
class MapsJob : public Cli {
 protected:
    Ended maps(const std::string& line, Words variables) const {
        const Words all{"PATH=" + search_path(), "VDBGEO=" + std::string(VDBGEO_PROGRAM),
                        "LIST=" + at("list"),    "OUT=" + at("out"),
                        "SLURM_CPUS_PER_TASK=1", "SLURM_ARRAY_TASK_ID=" + line};
        variables.insert(variables.begin(), all.begin(), all.end());
        return job("slurm/maps.sbatch", variables);
    }

    /// Changed, a file tells whether it is written again.
    void spoil(const std::string& name) const { make(name, "spoilt"); }
};

}  // namespace

TEST_F(MapsJob, AFolderAMap) {
    phantom("one.mrc", 40);
    phantom("two.rec", 32, {}, "torus");
    make("list", at("one.mrc") + "\n" + at("two.rec") + "\n");
    const Words how{"DO=surface", "DENOISE=--order 0 --steps 3", "ISO=1sigma"};
    for (const char* line : {"1", "2"}) {
        const Ended r = maps(line, how);
        EXPECT_EQ(r.code, 0) << r.err;
    }
    for (const auto& [map, name] : {std::pair("one.mrc", "one"), {"two.rec", "two"}}) {
        good({"denoise", at(map), at("a.vdb"), "--order", "0", "--steps", "3", "--quiet"});
        good({"surface", at("a.vdb"), at("a.ply"), "--iso", "1sigma", "--quiet"});
        EXPECT_TRUE(bytes("out/" + std::string(name) + "/surface.ply") == bytes("a.ply"));
        const Json told = Json::parse(bytes("out/" + std::string(name) + "/measures.json"), nullptr, false);
        EXPECT_EQ(told["faces"], json({"measure", at("a.ply")})["faces"]);
    }
    // What is done is skipped, unless something else is asked for.
    spoil("out/one/surface.ply");
    Ended r = maps("1", how);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(r.out.find("done before"), std::string::npos) << r.out;
    EXPECT_EQ(bytes("out/one/surface.ply"), "spoilt");
    r = maps("1", {"DO=surface", "DENOISE=--order 0 --steps 4", "ISO=1sigma"});
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(bytes("out/one/surface.ply"), "spoilt");
    // A failure is one: the next run does it again.
    r = maps("2", {"DO=surface", "ISO=1e9"});
    EXPECT_EQ(r.code, 5) << r.err;
    EXPECT_FALSE(fs::exists(folder_ / "out/two/done"));
    EXPECT_EQ(maps("2", how).code, 0);
}

TEST_F(MapsJob, AModelAMap) {
    phantom("one.mrc", 32);
    make("list", at("one.mrc") + "\n");
    const Words how{"MODEL=--to measure", "ISO=0.5"};
    const Ended r = maps("1", how);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_TRUE(fs::exists(folder_ / "out/one/mesh.ply"));
    EXPECT_TRUE(fs::exists(folder_ / "out/one/summary.json"));
    EXPECT_FALSE(fs::exists(folder_ / "out/one/curved.ply"));
    EXPECT_NE(maps("1", how).out.find("done before"), std::string::npos);
}

TEST_F(MapsJob, MistakesAreTold) {
    phantom("one.mrc", 16);
    make("list", at("one.mrc") + "\n\n" + at("sub/one.map.gz") + "\n");
    const auto expect = [&](const std::string& line, const Words& variables, const std::string& text) {
        const Ended r = maps(line, variables);
        EXPECT_EQ(r.code, 2) << text;
        EXPECT_EQ(r.err.rfind("maps.sbatch: error: ", 0), 0u) << r.err;
        EXPECT_NE(r.err.find(text), std::string::npos) << r.err;
    };
    expect("2", {}, "there is no map on line 2");
    expect("9", {}, "there is no map on line 9");
    expect("1", {}, "several maps would be written to");
    expect("3", {}, "several maps would be written to");
    expect("1", {"DO=all"}, "DO=all: model or surface");
    expect("1", {"LIST=" + at("none")}, "the list cannot be read");
    EXPECT_FALSE(fs::exists(folder_ / "out"));
}

class Snakemake : public Cli {
 protected:
    void SetUp() override {
        if (!have("snakemake")) GTEST_SKIP() << "NOT TESTED: snakemake is not installed";
    }

    Ended snakemake(const Words& settings) const {
        Words all{"/usr/bin/env", "HOME=" + at("home"), "snakemake", "-s", scripts + "snakemake/Snakefile",
                  "-d",           at("work"),           "--cores",   "2",  "--config"};
        all.insert(all.end(), settings.begin(), settings.end());
        all.push_back("vdbgeo=" + std::string(VDBGEO_PROGRAM));
        return run(all);
    }
};

TEST_F(Snakemake, ManyMapsAndATable) {
    fs::create_directories(folder_ / "work/data");
    phantom("work/data/ball.mrc", 40, {"--snr", "10"});
    phantom("work/data/ring.mrc.gz", 40, {"--snr", "10"}, "torus");
    const Words settings{"maps=data/*", "threads=1", "denoise=--order 0 --steps 4", "iso=1.5sigma",
                         "surface=--keep-largest 1"};
    Ended r = snakemake(settings);
    ASSERT_EQ(r.code, 0) << r.err;
    const std::string table = bytes("work/vdbgeo-out/table.csv");
    EXPECT_EQ(table.rfind("map,vertices,faces,components,genus,closed,area_A2,volume_A3,integral_K,", 0), 0u)
        << table;
    const Json ball = json({"measure", at("work/vdbgeo-out/ball/surface.ply")});
    EXPECT_NE(table.find("data/ball.mrc," + ball["vertices"].dump() + "," + ball["faces"].dump() + ",1,"),
              std::string::npos)
        << table;
    EXPECT_NE(table.find("data/ring.mrc.gz,"), std::string::npos) << table;
    r = snakemake(settings);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(r.err.find("Nothing to be done"), std::string::npos) << r.err;
    // A map that fails leaves no table.
    make("work/data/bad.mrc", "no map");
    r = snakemake(settings);
    EXPECT_NE(r.code, 0);
    EXPECT_NE(r.err.find("bad.mrc"), std::string::npos) << r.err;
}
