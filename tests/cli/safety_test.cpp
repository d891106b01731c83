// Full disks, limits, kills and interrupts: an output is the old file or the whole new one.
#include <sys/mount.h>

#include <cstring>

#include "tests/cli/cli_test.h"

using namespace vdbgeo::test;
using std::chrono::milliseconds;

namespace {

namespace fs = std::filesystem;

/// A command that writes one file, which is the word OUT.
struct Writer {
    Words words;
    const char* ending;
};

class Safety : public Cli {
 protected:
    /// Every command that writes files, reading what is made here in `in`.
    std::vector<Writer> writers() {
        fs::create_directory(folder_ / "in");
        const std::string map = phantom("in/a.mrc", 32, {"--snr", "1"}), mesh = at("in/a.ply"),
                          grid = at("in/a.vdb");
        good({"surface", map, mesh, "--iso", "0", "--quiet"});
        good({"convert", map, grid, "--quiet"});
        return {{{"convert", map, "OUT"}, ".vdb"},
                {{"convert", grid, "OUT"}, ".mrc"},
                {{"convert", mesh, "OUT"}, ".obj"},
                {{"convert", mesh, "OUT"}, ".off"},
                {{"convert", mesh, "OUT"}, ".stl"},
                {{"surface", map, "OUT", "--iso", "0"}, ".ply"},
                {{"phantom", "sphere", "OUT", "--size", "24"}, ".mrc"},
                {{"phantom", "sphere", "OUT", "--size", "24"}, ".vdb"},
                {{"phantom", "sphere", "/dev/null.mrc", "--size", "24", "--truth", "OUT"}, ".mrc"},
                {{"render", mesh, "OUT", "--width", "300", "--occlusion", "0"}, ".png"},
                {{"measure", mesh, "--histogram", "OUT"}, ".png"}};
    }

    static Words with_out(Words words, const std::string& out) {
        for (std::string& word : words) {
            if (word == "OUT") word = out;
            if (word == "/dev/null.mrc") word = out + ".other.mrc";
        }
        words.push_back("--quiet");
        return words;
    }

    std::string model_map() {
        fs::create_directory(folder_ / "in");
        return phantom("in/a.mrc", 32);
    }
    static Words model(const std::string& map, const std::string& folder) {
        return {"model", map,           "-o", folder,   "--iso", "9",      "--width",
                "200",   "--occlusion", "0",  "--skip", "tets",  "--quiet"};
    }
};

/// Whether the small file system could be mounted.
class SmallDisk {
 public:
    explicit SmallDisk(const fs::path& folder) : folder_(folder) {
        fs::create_directory(folder);
        mounted_ = ::mount("none", folder.c_str(), "tmpfs", 0, "size=64k,nr_inodes=20") == 0;
        error_ = mounted_ ? "" : std::strerror(errno);
    }
    ~SmallDisk() {
        if (mounted_) ::umount2(folder_.c_str(), MNT_DETACH);
    }
    SmallDisk(const SmallDisk&) = delete;
    SmallDisk& operator=(const SmallDisk&) = delete;
    bool mounted() const { return mounted_; }
    const std::string& error() const { return error_; }

 private:
    fs::path folder_;
    bool mounted_ = false;
    std::string error_;
};

}  // namespace

TEST_F(Safety, AFullDeviceIsFour) {
    for (const Writer& writer : writers()) {
        const std::string out = at(std::string("full") + writer.ending);
        fs::remove(out);
        fs::create_symlink("/dev/full", out);
        SCOPED_TRACE(joined(writer.words) + writer.ending);
        expect_error(vdbgeo(with_out(writer.words, out)), 4, out + ": ");
        EXPECT_TRUE(fs::is_symlink(out));
    }
    const std::string map = at("in/a.mrc");
    for (const char* name : {"density.vdb", "surface.ply", "angles.svg", "map.png", "summary.json"}) {
        fs::remove_all(folder_ / "m");
        fs::create_directory(folder_ / "m");
        fs::create_symlink("/dev/full", folder_ / "m" / name);
        SCOPED_TRACE(name);
        expect_error(vdbgeo(model(map, at("m"))), 4, at("m") + "/" + name + ": ");
    }
    expect_error(vdbgeo(model(map, "/dev/full")), 4, "/dev/full: ");
}

TEST_F(Safety, StandardOutputOnAFullDeviceIsFour) {
    const std::string map = phantom("a.mrc", 16);
    RunOptions full;
    full.output = "/dev/full";
    expect_error(vdbgeo({"info", map, "--json", "--quiet"}, full), 4, "standard output: ");
    expect_error(vdbgeo({"info", map, "--quiet"}, full), 4, "standard output: ");
    expect_error(vdbgeo({"convert", map, "-", "--quiet"}, full), 4, "standard output: ");
}

TEST_F(Safety, AFileSizeLimitLeavesTheOldFile) {
    for (const Writer& writer : writers()) {
        const std::string name = std::string("old") + writer.ending, out = at(name), content(5000, 'o');
        make(name, content);
        const auto before = listing();
        RunOptions small;
        small.limits = {{RLIMIT_FSIZE, 2000}};
        SCOPED_TRACE(joined(writer.words) + writer.ending);
        const Ended r = vdbgeo(with_out(writer.words, out), small);
        EXPECT_EQ(r.code, 4) << r.err;
        EXPECT_NE(r.err.find("File too large"), std::string::npos) << r.err;
        EXPECT_TRUE(bytes(name) == content);
        EXPECT_EQ(listing(), before);
        fs::remove(out);
    }
}

TEST_F(Safety, ModelUnderAFileSizeLimitLeavesOldFilesOrWholeNewOnes) {
    const std::string map = model_map();
    good(model(map, at("whole")));
    std::set<std::string> allowed;
    for (const auto& entry : fs::directory_iterator(folder_ / "whole"))
        allowed.insert(entry.path().filename().string());
    fs::create_directory(folder_ / "m");
    for (const std::string& name : allowed) make("m/" + name, "as it was");
    for (const char* longest : {"angles.svg", "surface.ply", "density.vdb"}) {
        const std::uint64_t limit = fs::file_size(folder_ / "whole" / longest) - 1;
        RunOptions small;
        small.limits = {{RLIMIT_FSIZE, limit}};
        const Ended r = vdbgeo(model(map, at("m")), small);
        EXPECT_EQ(r.code, 4) << limit << " " << r.err;
        for (const auto& entry : fs::directory_iterator(folder_ / "m")) {
            const std::string name = entry.path().filename().string();
            EXPECT_TRUE(allowed.count(name)) << limit << " " << name;
            const std::string found = bytes("m/" + name);
            if (name == "summary.json")
                EXPECT_EQ(Json::parse(found)["status"], "failed") << limit;
            else
                EXPECT_TRUE(found == "as it was" || found == bytes("whole/" + name)) << limit << " " << name;
        }
    }
}

TEST_F(Safety, ASmallDiskLeavesTheOldFile) {
    const auto all = writers();
    const SmallDisk disk(folder_ / "disk");
    if (!disk.mounted()) GTEST_SKIP() << "NOT TESTED: a small tmpfs cannot be mounted here: " << disk.error();
    make("disk/fill", std::string(40000, 'f'));
    for (const Writer& writer : all) {
        const std::string name = std::string("disk/old") + writer.ending;
        if (writer.words[0] == "measure") continue;  // its picture fits
        make(name, "as it was");
        const auto before = listing();
        SCOPED_TRACE(joined(writer.words) + writer.ending);
        const Ended r = vdbgeo(with_out(writer.words, at(name)));
        EXPECT_EQ(r.code, 4) << r.err;
        EXPECT_NE(r.err.find("No space left"), std::string::npos) << r.err;
        EXPECT_EQ(bytes(name), "as it was");
        EXPECT_EQ(listing(), before);
        fs::remove(folder_ / name);
    }
}

TEST_F(Safety, FoldersThatAreNotThereAreFour) {
    for (const Writer& writer : writers()) {
        SCOPED_TRACE(joined(writer.words) + writer.ending);
        for (const char* folder : {"none/deep/", "in/a.mrc/"}) {
            const std::string out = at(folder + std::string("out") + writer.ending);
            const Ended r = vdbgeo(with_out(writer.words, out));
            EXPECT_EQ(r.code, 4) << r.err;
            EXPECT_EQ(r.err.rfind("vdbgeo: error: " + at(folder), 0), 0u) << r.err;
        }
        fs::create_directory(at(std::string("folder") + writer.ending));
        const std::string folder = at(std::string("folder") + writer.ending);
        expect_error(vdbgeo(with_out(writer.words, folder)), 4, folder + ": ", "is a directory");
    }
    const std::string map = at("in/a.mrc");
    expect_error(vdbgeo(model(map, map)), 4, map + ": ");
    expect_error(vdbgeo(model(map, map + "/m")), 4, map + "/m: ");
    EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST_F(Safety, FoldersThatCannotBeWrittenAreFour) {
    if (::geteuid() != 0) GTEST_SKIP() << "NOT TESTED: needs root, to become a user who may not write";
    const auto all = writers();
    fs::permissions(folder_.path(), fs::perms(0755));
    RunOptions nobody;
    nobody.user = 65534;
    if (vdbgeo({"--version"}, nobody).code != 0)
        GTEST_SKIP() << "NOT TESTED: another user cannot run the programs in this folder";
    for (const Writer& writer : all) {
        SCOPED_TRACE(joined(writer.words) + writer.ending);
        const std::string name = std::string("out") + writer.ending;
        expect_error(vdbgeo(with_out({writer.words}, at(name)), nobody), 4, folder_.path().string());
        EXPECT_FALSE(fs::exists(folder_ / name));
        make(name, "as it was");
        expect_error(vdbgeo(with_out({writer.words}, at(name)), nobody), 4, folder_.path().string());
        EXPECT_EQ(bytes(name), "as it was");
        fs::remove(folder_ / name);
    }
    expect_error(vdbgeo(model(at("in/a.mrc"), at("m")), nobody), 4, at("m") + ": ");
}

TEST_F(Safety, KilledInTheMiddleOfWriting) {
    const std::string map = phantom("a.mrc", 192), content = "as it was";
    good({"convert", map, at("whole.vdb"), "--compression", "none", "--quiet"});
    good({"convert", at("whole.vdb"), at("whole.mrc"), "--quiet"});
    const auto kill_at = [&](const Words& words, const std::string& name, const RunOptions& options) {
        make(name, content);
        const Ended r = vdbgeo(words, options);
        EXPECT_TRUE(r.killed == SIGKILL || r.code == 0) << r.err;
        const std::string found = bytes(name);
        const std::string whole = bytes(name == "out.vdb" ? "whole.vdb" : "whole.mrc");
        EXPECT_TRUE(found == content || found == whole) << found.size() << " bytes";
        return r.killed.has_value();
    };
    int killed = 0;
    for (const int delay : {1, 20, 60, 120, 200, 400}) {
        for (const bool to_grid : {true, false}) {
            const std::string name = to_grid ? "out.vdb" : "out.mrc";
            Words words{"convert", at(to_grid ? "a.mrc" : "whole.vdb"), at(name)};
            if (to_grid) words.insert(words.end(), {"--compression", "none"});
            RunOptions options;
            options.signal_after = milliseconds(delay);
            killed += kill_at(words, name, options);
        }
    }
    EXPECT_GT(killed, 0);
    // Just when writing begins.
    RunOptions writing;
    writing.signal_at = "reading";
    kill_at({"convert", map, at("out.vdb"), "--compression", "none"}, "out.vdb", writing);
    kill_at({"convert", at("whole.vdb"), at("out.mrc")}, "out.mrc", writing);
}

TEST_F(Safety, AnInterruptedModelIs130) {
    const std::string map = phantom("a.mrc", 200, {"--snr", "1"}, "atpase");
    const auto before = listing();
    // Not at the very start, where the program does not listen yet.
    const std::vector<std::pair<const char*, int>> moments{
        {"map ", SIGINT}, {"denoise ", SIGINT}, {"statistics ", SIGINT}, {"statistics ", SIGTERM}};
    const std::set<std::string> ours{"m",
                                     "m/summary.json",
                                     "m/density.vdb",
                                     "m/smooth.vdb",
                                     "m/spectra.svg",
                                     "m/surface.ply",
                                     "m/density.svg",
                                     "m/isovalues.svg",
                                     "m/mesh.ply",
                                     "m/angles.svg"};
    for (const auto& [moment, signal] : moments) {
        SCOPED_TRACE(std::string(moment) + (signal == SIGINT ? "SIGINT" : "SIGTERM"));
        RunOptions options;
        options.signal = signal;
        options.signal_at = moment;
        fs::remove_all(folder_ / "m");
        const Ended r = vdbgeo({"model", map, "-o", at("m"), "--iso", "0.5"}, options);
        EXPECT_TRUE(r.signalled);
        EXPECT_EQ(r.code, 130) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_NE(r.err.find("vdbgeo: error: interrupted\n"), std::string::npos) << r.err;
        for (const std::string& name : listing())
            EXPECT_TRUE(before.count(name) || ours.count(name) || name.rfind("m/slices_", 0) == 0) << name;
        EXPECT_EQ(Json::parse(bytes("m/summary.json"))["status"], "interrupted");
        if (fs::exists(folder_ / "m/density.vdb")) good({"info", at("m/density.vdb")});
        if (fs::exists(folder_ / "m/surface.ply")) good({"measure", at("m/surface.ply")});
    }
}
