// The tutorial does what it says: its commands, in their order, on the map that it makes.
#include <fstream>
#include <sstream>

#include "tests/cli/cli_test.h"
#include "vdbgeo/view/render.h"

using namespace vdbgeo::test;

namespace {

/// The indented lines of a page that call a program of this project.
Words commands_of(const std::filesystem::path& page) {
    std::ifstream in(page);
    Words commands;
    for (std::string line; std::getline(in, line);)
        if (line.rfind("    vdbgeo ", 0) == 0) commands.push_back(line.substr(4));
    return commands;
}

/// Files that a command line names as its results: every word that ends like one.
Words files_in(const std::string& command) {
    Words files;
    std::istringstream words(command);
    for (std::string word; words >> word;)
        for (const char* ending : {".mrc", ".png", ".svg", ".ply", ".csv", ".vtu", ".msh", ".vdb", ".glb"})
            if (word.size() > 4 && word.compare(word.size() - 4, 4, ending) == 0) files.push_back(word);
    return files;
}

class Tutorial : public Cli {};

}  // namespace

TEST_F(Tutorial, EveryCommandRunsAndLeavesItsFiles) {
    if (!vdbgeo::can_render()) GTEST_SKIP() << "the tutorial draws pictures, which needs embree";
    const Words commands = commands_of(std::filesystem::path(VDBGEO_SOURCE_FOLDER) / "docs/tutorial.md");
    ASSERT_GT(commands.size(), 15u);
    for (const std::string& command : commands) {
        RunOptions options;
        options.folder = folder_.path();
        const std::string line = std::string(VDBGEO_PROGRAM) + command.substr(6) + " --quiet";
        const Ended r = run({"/bin/sh", "-c", line}, options);
        ASSERT_EQ(r.code, 0) << command << "\n" << r.err;
        for (const std::string& file : files_in(command)) {
            EXPECT_TRUE(std::filesystem::exists(folder_ / file)) << command << ": " << file;
            EXPECT_GT(std::filesystem::file_size(folder_ / file), 100u) << command << ": " << file;
        }
    }
    for (const char* file : {"atpase/report.html", "again/report.html", "atpase/summary.json"})
        EXPECT_TRUE(std::filesystem::exists(folder_ / file)) << file;
    EXPECT_TRUE(bytes("atpase/curved.ply") == bytes("again/curved.ply"));
}
