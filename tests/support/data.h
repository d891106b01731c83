// Real files for the tests. They are not part of the project: VDBGEO_DATA names the folder that holds them,
// and a test that needs one is skipped, saying so, where it is absent.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace vdbgeo::test {

/// The folder with real maps, empty where there is none.
inline std::filesystem::path data_folder() {
    const char* folder = std::getenv("VDBGEO_DATA");
    return folder ? std::filesystem::path(folder) : std::filesystem::path();
}

inline bool have_data(const std::string& name) {
    return !data_folder().empty() && std::filesystem::exists(data_folder() / name);
}

}  // namespace vdbgeo::test

/// Skips the running test where the real file `name` is absent.
#define VDBGEO_NEEDS_DATA(name)                                                               \
    do {                                                                                      \
        if (!vdbgeo::test::have_data(name))                                                   \
            GTEST_SKIP() << "needs the real file " << (name) << " in the folder VDBGEO_DATA"; \
    } while (false)
