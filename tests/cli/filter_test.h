// What the tests of the commands that make a map of a map share.
#pragma once

#include <png.h>

#include <cstring>
#include <set>

#include "tests/cli/cli_test.h"

namespace vdbgeo::test {

class FilterCli : public Cli {
 protected:
    /// The samples of a plain MRC file of mode 2.
    std::vector<float> samples(const std::string& name) const {
        const std::string all = bytes(name);
        std::vector<float> values(all.size() > 1024 ? (all.size() - 1024) / 4 : 0);
        std::memcpy(values.data(), all.data() + 1024, 4 * values.size());
        return values;
    }

    /// A noisy specimen and its truth.
    std::string noisy(const std::string& name, int n, const std::string& snr = "1") const {
        return phantom(name, n, {"--snr", snr, "--seed", "3", "--truth", at("truth_" + name)}, "atpase");
    }

    /// Runs with 1, 2 and all threads: `outs` always have the same bytes.
    void expect_same_bytes(const Words& words, const Words& outs) const {
        std::vector<std::string> first;
        for (const char* threads : {"1", "2", "5"}) {
            SCOPED_TRACE(joined(words) + "threads " + threads);
            Words full = words;
            full.insert(full.end(), {"--threads", threads, "--quiet"});
            good(full);
            std::vector<std::string> found;
            for (const std::string& out : outs) {
                found.push_back(bytes(out));
                EXPECT_GT(found.back().size(), 100u) << out;
                std::filesystem::remove(folder_ / out);
            }
            if (first.empty()) first = found;
            for (std::size_t i = 0; i < outs.size(); ++i) EXPECT_TRUE(found[i] == first[i]) << outs[i];
        }
    }

    /// A PNG that can be read and shows something: many different greys.
    void expect_picture(const std::string& name) const {
        png_image header{};
        header.version = PNG_IMAGE_VERSION;
        ASSERT_TRUE(png_image_begin_read_from_file(&header, at(name).c_str())) << name;
        header.format = PNG_FORMAT_RGB;
        std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(header));
        png_image_finish_read(&header, nullptr, pixels.data(), 0, nullptr);
        EXPECT_GE(header.width, 600u);
        EXPECT_GE(header.height, 600u);
        EXPECT_GT(std::set<std::uint8_t>(pixels.begin(), pixels.end()).size(), 100u) << name;
    }

    static void expect_keys(const Json& j, const Words& keys) {
        for (const std::string& key : keys) EXPECT_TRUE(j.contains(key)) << key << "\n" << j.dump();
    }
};

inline double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
    EXPECT_EQ(a.size(), b.size());
    double most = 0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        most = std::max(most, std::abs(double(a[i]) - double(b[i])));
    return most;
}

inline double rms_of_difference(const std::vector<float>& a, const std::vector<float>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        sum += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i]));
    return std::sqrt(sum / static_cast<double>(a.size()));
}

}  // namespace vdbgeo::test
