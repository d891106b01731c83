#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "vdbgeo/view/page_assets.h"

namespace vdbgeo {
namespace {

std::string file_text(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    EXPECT_TRUE(in.is_open()) << path;
    return {std::istreambuf_iterator<char>(in), {}};
}

TEST(PageAssets, StyleIsTheFile) {
    EXPECT_EQ(page_style(), file_text(PAGE_STYLE));
    EXPECT_EQ(page_style().find("</style"), std::string_view::npos);
}

TEST(PageAssets, ScriptIsTheBundleOrNothing) {
#ifdef PAGE_SCRIPT
    EXPECT_TRUE(have_page());
    EXPECT_EQ(page_script(), file_text(PAGE_SCRIPT));
    EXPECT_NE(page_script().find("vdbgeo-data"), std::string_view::npos);
    EXPECT_NE(page_script().find("The above copyright notice and this permission notice shall be included"),
              std::string_view::npos);
    for (const char* word : {"</script", "<!--"})
        EXPECT_EQ(page_script().find(word), std::string_view::npos) << word;
#else
    EXPECT_FALSE(have_page());
    EXPECT_TRUE(page_script().empty());
#endif
}

}  // namespace
}  // namespace vdbgeo
