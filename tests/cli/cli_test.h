// What the tests of the programs share: a folder, short ways to run them, and the contract of an error.
#pragma once

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <set>
#include <string>
#include <vector>

#include "tests/support/run.h"
#include "tests/support/temp_folder.h"

namespace vdbgeo::test {

using Json = nlohmann::json;
using Words = std::vector<std::string>;

inline std::string joined(const Words& words) {
    std::string line;
    for (const std::string& word : words) line += word + " ";
    return line;
}

class Cli : public testing::Test {
 protected:
    static Ended vdbgeo(Words words, const RunOptions& options = {}) {
        words.insert(words.begin(), VDBGEO_PROGRAM);
        return run(words, options);
    }

    /// The path of a file in the test's folder.
    std::string at(const std::string& name) const { return (folder_ / name).string(); }
    std::string bytes(const std::string& name) const { return read_bytes(folder_ / name); }
    std::string make(const std::string& name, const std::string& content) const {
        write_bytes(folder_ / name, content);
        return at(name);
    }

    /// A run that has to go well.
    Ended good(const Words& words, const RunOptions& options = {}) const {
        const Ended r = vdbgeo(words, options);
        EXPECT_EQ(r.code, 0) << joined(words) << "\n" << r.err;
        return r;
    }

    /// The one JSON object on standard output of a run that has to go well.
    Json json(Words words) const {
        words.push_back("--json");
        const Ended r = good(words);
        const Json j = Json::parse(r.out, nullptr, false);
        EXPECT_TRUE(j.is_object()) << joined(words) << "\n" << r.out;
        return j.is_object() ? j : Json::object();
    }

    /// A phantom of n³ voxels in the test's folder; the same bytes each time.
    std::string phantom(const std::string& name, int n, Words more = {},
                        const std::string& kind = "sphere") const {
        Words words{"phantom", kind, at(name), "--size", std::to_string(n), "--quiet"};
        words.insert(words.end(), more.begin(), more.end());
        good(words);
        return at(name);
    }

    /// Everything in the test's folder, below it too.
    std::set<std::string> listing() const {
        std::set<std::string> names;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.path()))
            names.insert(entry.path().lexically_relative(folder_.path()).string());
        return names;
    }

    TempFolder folder_;
};

/// An error: this exit code, nothing on standard output, and on standard error one line only, which begins
/// with the program's name and then `subject` (the file, mostly), and has `text` in it.
inline void expect_error(const Ended& r, int code, const std::string& subject, const std::string& text = "",
                         const std::string& program = "vdbgeo") {
    EXPECT_EQ(r.code, code) << r.err;
    EXPECT_EQ(r.out, "");
    EXPECT_EQ(r.err.rfind(program + ": error: " + subject, 0), 0u) << r.err << "expected: " << subject;
    EXPECT_EQ(r.err.find('\n'), r.err.size() - 1) << r.err;
    EXPECT_NE(r.err.find(text), std::string::npos) << r.err << "expected: " << text;
}

}  // namespace vdbgeo::test
