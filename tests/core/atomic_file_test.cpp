// A target is either the old file or the whole new one.
#include "vdbgeo/core/atomic_file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;

namespace {

std::size_t files_in(const std::filesystem::path& folder) {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

}  // namespace

TEST(AtomicFile, ReplacesTheOldFileOnCommitAndNotBefore) {
    TempFolder folder;
    write_bytes(folder / "a", "old");
    AtomicFile file(folder / "a");
    file.write("new and longer");
    EXPECT_EQ(read_bytes(folder / "a"), "old");
    file.commit();
    EXPECT_EQ(read_bytes(folder / "a"), "new and longer");
    EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(AtomicFile, LeavesNothingWithoutCommit) {
    TempFolder folder;
    write_bytes(folder / "a", "old");
    {
        AtomicFile file(folder / "a");
        file.write(std::string(5 << 20, 'x'));
    }
    EXPECT_EQ(read_bytes(folder / "a"), "old");
    EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(AtomicFile, SeeksBackToPatchEarlierBytes) {
    TempFolder folder;
    AtomicFile file(folder / "a");
    std::string body(3 << 20, 'b');
    file.stream() << "????" << body;
    file.stream().seekp(0);
    file.stream() << "head";
    file.stream().seekp(0, std::ios::end);
    EXPECT_EQ(file.stream().tellp(), std::streampos((3 << 20) + 4));
    file.stream() << "tail";
    file.commit();
    EXPECT_EQ(read_bytes(folder / "a"), "head" + body + "tail");
}

TEST(AtomicFile, KeepsThePermissionsOfTheFileItReplaces) {
    TempFolder folder;
    write_bytes(folder / "a", "old");
    std::filesystem::permissions(folder / "a", std::filesystem::perms(0640));
    write_file(folder / "a", "new");
    EXPECT_EQ(std::filesystem::status(folder / "a").permissions(), std::filesystem::perms(0640));
}

TEST(AtomicFile, ReplacesWhatALinkPointsTo) {
    TempFolder folder;
    write_bytes(folder / "real", "old");
    std::filesystem::create_symlink("real", folder / "link");
    write_file(folder / "link", "new");
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
    EXPECT_EQ(read_bytes(folder / "real"), "new");
}

TEST(AtomicFile, AFullDeviceIsAnError) {
    EXPECT_THROW(write_file("/dev/full", "x"), IoError);
    AtomicFile file("/dev/full");
    EXPECT_THROW(file.stream() << std::string(4 << 20, 'x'), IoError);
}

TEST(AtomicFile, AfterALostWriteNothingIsCommitted) {
    AtomicFile file("/dev/full");
    EXPECT_THROW(file.write(std::string(4 << 20, 'x')), IoError);
    EXPECT_THROW(file.commit(), IoError);
}

TEST(AtomicFile, ANameMayBeAsLongAsTheFileSystemAllows) {
    TempFolder folder;
    const std::string name(255, 'n');
    write_file(folder / name, "text");
    EXPECT_EQ(read_bytes(folder / name), "text");
    EXPECT_THROW(write_file(folder / (name + "n"), "text"), IoError);
    EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(AtomicFile, AMissingFolderAndAFolderAreErrors) {
    TempFolder folder;
    EXPECT_THROW(AtomicFile(folder / "none/a"), IoError);
    EXPECT_THROW(AtomicFile{folder.path()}, IoError);
}

TEST(AtomicFile, AFileSizeLimitLeavesTheOldFile) {
    TempFolder folder;
    write_bytes(folder / "a", "old");
    const pid_t child = fork();
    if (child == 0) {
        signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{1 << 20, 1 << 20};
        setrlimit(RLIMIT_FSIZE, &limit);
        try {
            write_file(folder / "a", std::string(4 << 20, 'x'));
        } catch (const IoError&) {
            _exit(4);
        }
        _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(WEXITSTATUS(status), 4);
    EXPECT_EQ(read_bytes(folder / "a"), "old");
}

TEST(AtomicFile, AKilledWriterLeavesTheOldFile) {
    TempFolder folder;
    write_bytes(folder / "a", "old");
    int ready[2];
    ASSERT_EQ(pipe(ready), 0);
    const pid_t child = fork();
    if (child == 0) {
        AtomicFile file(folder / "a");
        file.write(std::string(4 << 20, 'x'));
        if (write(ready[1], "r", 1) != 1) _exit(1);
        pause();
        _exit(0);
    }
    char byte;
    ASSERT_EQ(read(ready[0], &byte, 1), 1);
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(read_bytes(folder / "a"), "old");
}

TEST(AtomicFile, WhatWasWrittenCanBeReadBackAndOverwritten) {
    TempFolder folder;
    AtomicFile file(folder / "a");
    EXPECT_TRUE(file.seekable());
    file.write("head, ");
    file.write(std::string(3 << 20, 'x'));
    EXPECT_EQ(file.flush(), 6u + (3u << 20));
    std::string back(4, '\0');
    file.read_at(0, back.data(), back.size());
    EXPECT_EQ(back, "head");
    file.write_at(0, "HEAD", 4);
    file.write(" end");
    EXPECT_THROW(file.read_at(10u << 20, back.data(), back.size()), IoError) << "beyond the end";
    file.commit();
    EXPECT_TRUE(read_bytes(folder / "a") == "HEAD, " + std::string(3 << 20, 'x') + " end");
    EXPECT_FALSE(AtomicFile("/dev/null").seekable());
}
