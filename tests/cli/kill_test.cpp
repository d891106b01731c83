// Killed or interrupted at any moment, a conversion leaves nothing, or all of its file.
#include <algorithm>
#include <random>

#include "tests/cli/cli_test.h"

using namespace vdbgeo::test;

namespace {

namespace fs = std::filesystem;

/// Signals a conversion at moments spread over its run, into a folder of its own.
class Kill : public Cli {
 protected:
    void SetUp() override {
        fs::create_directory(folder_ / "out");
        const std::string map = phantom("noise.mrc", sanitized ? 64 : 144, {"--snr", "1"});
        good({"convert", map, at("grid.vdb"), "--compression", "none", "--quiet"});
        // A killed process can only vanish without a trace where files without a name exist.
        const int nameless = ::open((folder_ / "out").c_str(), O_TMPFILE | O_WRONLY, 0600);
        nameless_ = nameless >= 0;
        if (nameless_) ::close(nameless);
    }

    Words to_grid() const { return {"convert", at("noise.mrc"), at("out/new.vdb"), "--compression", "zip"}; }
    Words to_map() const { return {"convert", at("grid.vdb"), at("out/new.mrc")}; }

    /// One moment in each tenth of an undisturbed run, and a little after its end.
    std::vector<std::chrono::milliseconds> moments(unsigned seed) const {
        std::mt19937 random(seed);
        std::vector<std::chrono::milliseconds> times;
        for (int i = 0; i < 10; ++i)
            times.emplace_back(static_cast<int>(1050 * whole_seconds_ * (i + random() * 0x1p-32) / 10));
        return times;
    }

    /// An undisturbed run: its bytes, and the time it takes.
    void run_whole(const Words& words) {
        name_ = fs::path(words[2]).filename();
        good(words);  // the first run waits for the disk
        whole_seconds_ = good(words).seconds;
        whole_ = bytes("out/" + name_);
        fs::remove(words[2]);
        ASSERT_FALSE(whole_.empty());
    }

    /// No file at all in the folder, or where it may be there the whole one.
    void expect_nothing_or_all(bool may_be_there) {
        for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
            const std::string found = entry.path().filename();
            if (found == name_) {
                EXPECT_TRUE(may_be_there);
                EXPECT_TRUE(bytes("out/" + found) == whole_) << "a part of the file was left";
            } else {
                ADD_FAILURE() << found << " was left";
            }
            fs::remove(entry.path());
        }
    }

    void kill(const Words& words) {
        run_whole(words);
        int killed = 0;
        for (const auto moment : moments(1)) {
            SCOPED_TRACE(testing::Message() << words[2] << " killed after " << moment.count() << " ms");
            RunOptions options;
            options.signal_after = moment;
            const Ended r = vdbgeo(words, options);
            EXPECT_TRUE(r.killed == SIGKILL || r.code == 0) << r.err;
            killed += r.killed.has_value();
            if (nameless_ || !r.killed) expect_nothing_or_all(true);
            fs::remove(words[2]);
        }
        EXPECT_GT(killed, 0);
    }

    /// SIGINT and SIGTERM in turns.
    void interrupt(const Words& words) {
        run_whole(words);
        std::vector<double> answers;
        RunOptions options;
        options.signal_heard = true;
        options.signal = SIGTERM;
        for (const auto moment : moments(2)) {
            SCOPED_TRACE(testing::Message() << words[2] << " signalled after " << moment.count() << " ms");
            options.signal = options.signal == SIGINT ? SIGTERM : SIGINT;
            options.signal_after = moment;
            const Ended r = vdbgeo(words, options);
            EXPECT_TRUE(r.code == 130 || r.code == 0) << r.err;
            expect_nothing_or_all(r.code == 0);
            if (r.code != 130) continue;
            EXPECT_NE(r.err.find("vdbgeo: error: interrupted\n"), std::string::npos) << r.err;
            answers.push_back(r.seconds - r.seconds_signalled);
        }
        EXPECT_FALSE(answers.empty());
        // The middle one: a busy machine may hold up one or two.
        if (sanitized || answers.empty()) return;
        std::sort(answers.begin(), answers.end());
        EXPECT_LT(answers[answers.size() / 2], 1.0);
    }

    std::string name_, whole_;
    double whole_seconds_ = 0;
    bool nameless_ = false;
};

}  // namespace

TEST_F(Kill, WritingAGrid) {
    kill(to_grid());
    if (!nameless_)
        GTEST_SKIP() << "NOT TESTED: files without a name cannot be made here, so a temporary one may stay";
}

TEST_F(Kill, WritingAMap) {
    kill(to_map());
    if (!nameless_)
        GTEST_SKIP() << "NOT TESTED: files without a name cannot be made here, so a temporary one may stay";
}

TEST_F(Kill, InterruptedWhileWritingAGrid) { interrupt(to_grid()); }
TEST_F(Kill, InterruptedWhileWritingAMap) { interrupt(to_map()); }
