// The report as HTML: whole, sound, harmless.
#include "vdbgeo/view/report_page.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/html.h"
#include "tests/support/small_meshes.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/page_assets.h"
#include "vdbgeo/view/page_images.h"
#include "vdbgeo/view/page_mesh.h"
#include "vdbgeo/view/png.h"

using namespace vdbgeo;
using namespace vdbgeo::test;
using Json = nlohmann::json;

namespace {

const std::string evil = "<script>alert(1)</script>\"' &amp; \xFF onload=\"x\"";
const std::string plain_svg =
    "<?xml version=\"1.0\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 4 4\" role=\"img\" "
    "aria-label=\"T\"><title>T</title><defs><clipPath id=\"box\"><rect x=\"0\" y=\"0\" width=\"4\" "
    "height=\"4\"/>"
    "</clipPath></defs><g clip-path=\"url(#box)\"><path class=\"ink-line\" d=\"M0 0L4 4\"/></g>"
    "<text class=\"ink-text\" x=\"1\" y=\"2\">a &lt; b</text></svg>\n";

PagePng small_png() {
    const TempFolder folder;
    write_png(Image(5, 3, Vec3f(0.2f, 0.4f, 0.6f)), folder / "a.png");
    return {read_bytes(folder / "a.png"), 5, 3, evil};
}

/// Every field filled with a text that would be trouble if it were not escaped.
ReportContent full_content() {
    ReportContent c;
    c.title = c.subtitle = evil;
    c.summary = {evil};
    c.facts = {{evil, evil}};
    c.poster = small_png();
    c.specimen = {evil};
    c.surface = packed_surface(tetrahedron(), {}, 4);
    c.pocket_places = {{7, Vec3d(1, 2, 3), Vec3d(0, 0, 1), 4.5}};
    c.pockets_text = {evil};
    c.pockets = {"pocket-table", evil, {{evil}, {"Area"}}, {}, 2};
    for (int i = 1; i <= 5; ++i) c.pockets.rows.push_back({std::to_string(i), evil});
    c.comparisons = {{'z', small_png(), small_png()}};
    c.noise = {{evil, evil, plain_svg, {}}};
    c.plots = {{evil, evil, plain_svg, {}}, {"b", "c", "<svg><script>alert(2)</script></svg>", {}}};
    c.pictures = {{evil, evil, "", small_png()}};
    c.numbers = {{evil, evil, {"numbers-1", "", {{"Quantity", false}, {"Value"}}, {{evil, evil}}, SIZE_MAX}}};
    c.glossary = {{evil, evil}};
    c.how_text = {evil};
    c.how = {{evil, evil, evil, evil, {evil}}};
    c.how_tables = {{"options", evil, {{"Name", false}}, {{evil}}, SIZE_MAX}};
    c.citations = {{"See doi:10.1002/cnm.2532 :", evil}};
    c.missing = {{evil, evil}};
    return c;
}

std::string joined(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += line + "\n";
    return text;
}

}  // namespace

TEST(ReportPage, IsSoundAndHarmlessWhateverTheTexts) {
    const HtmlPage page = HtmlReader::read(report_html(full_content()));
    EXPECT_EQ(joined(page.problems), "");
    for (const char* id : {"summary", "specimen", "pockets", "noise", "plots", "pictures", "numbers", "how",
                           "cite", "missing", "viewer", "pocket-table", "pocket-table-more", "vdbgeo-data"})
        EXPECT_TRUE(page.ids.count(id)) << id;
    for (const std::string& source : page.sources)
        EXPECT_EQ(source.rfind("data:image/", 0), 0u) << source.substr(0, 40);
    for (const std::string& link : page.links)
        EXPECT_TRUE(link.rfind("#", 0) == 0 || link == "data:," || link.rfind("https://doi.org/", 0) == 0)
            << link;
    const Json data = Json::parse(page.data);
    EXPECT_EQ(data["version"], 1);
    EXPECT_EQ(data["surface"]["faces"], 4);
    EXPECT_TRUE(data["tets"].is_null());
    EXPECT_EQ(data["pockets"][0],
              Json({{"id", 7}, {"centre", {1, 2, 3}}, {"opening", {0, 0, 1}}, {"radius", 4.5}}));
    EXPECT_EQ(data["colormaps"]["sequential"].size(), 256u);
    EXPECT_EQ(data["colormaps"]["diverging"].size(), 256u);
    EXPECT_EQ(data["colormaps"]["categorical"].size(), 8u);
    EXPECT_EQ(data["colormaps"]["sequential"][0].get<std::string>().size(), 7u);
}

TEST(ReportPage, LeavesOutWhatIsNotThere) {
    ReportContent c;
    c.title = "Nothing";
    c.missing = {{"Everything", "It was not made."}};
    const HtmlPage page = HtmlReader::read(report_html(c));
    EXPECT_EQ(joined(page.problems), "");
    for (const char* id :
         {"summary", "specimen", "pockets", "noise", "plots", "pictures", "numbers", "how", "cite"})
        EXPECT_FALSE(page.ids.count(id)) << id;
    EXPECT_NE(page.words.find("It was not made."), std::string::npos);
    EXPECT_TRUE(Json::parse(page.data)["surface"].is_null());
}

TEST(ReportPage, FoldsUpLongTablesAndCopiesAll) {
    const std::string html = report_html(full_content());
    EXPECT_NE(html.find("<tr data-pocket=\"2\">"), std::string::npos);
    EXPECT_GT(html.find("<tr data-pocket=\"3\">"), html.find("<summary>3 more</summary>"));
    EXPECT_NE(html.find("data-copy=\"pocket-table\""), std::string::npos);
    EXPECT_NE(html.find("data-copy=\"bibtex-1\""), std::string::npos);
}

TEST(ReportPage, PlainDrawingsStandInThePageOthersInAnImage) {
    const std::string html = report_html(full_content());
    // Ids are each drawing's own: it comes twice.
    EXPECT_NE(html.find("id=\"plot1-box\""), std::string::npos);
    EXPECT_NE(html.find("url(#plot1-box)"), std::string::npos);
    EXPECT_NE(html.find("id=\"plot1000-box\""), std::string::npos);
    EXPECT_EQ(html.find(" id=\"box\""), std::string::npos);
    EXPECT_EQ(html.find("alert(2)"), std::string::npos);
    EXPECT_NE(html.find("data:image/svg+xml;base64,"), std::string::npos);
}

TEST(ReportPage, SameContentSameBytes) {
    EXPECT_EQ(report_html(full_content()), report_html(full_content()));
}

TEST(PageImages, PlainDrawings) {
    EXPECT_TRUE(is_plain_svg(plain_svg));
    EXPECT_TRUE(is_plain_svg("<svg/>") == is_svg("<svg/>"));
    const auto with = [](const std::string& inside) {
        return "<svg xmlns=\"http://www.w3.org/2000/svg\">" + inside + "</svg>";
    };
    EXPECT_TRUE(is_plain_svg(with("<g></g>")));
    const std::vector<std::string> others{with("<script>x</script>"),
                                          with("<g onclick=\"x\"/>"),
                                          with("<a href=\"x\"></a>"),
                                          with("<style>x</style>"),
                                          with("<image href=\"http://a/b.png\"/>"),
                                          with("<foreignObject/>"),
                                          with("<g fill=\"url(http://a/b)\"/>"),
                                          with("<g fill=\"url(#a) url(//b)\"/>"),
                                          with("<!-- x -->"),
                                          with("<![CDATA[x]]>"),
                                          with("<g>"),
                                          with("</g>"),
                                          with("<g style=\"x\"/>"),
                                          with("<g id=x/>"),
                                          with("<g id='x'/>"),
                                          with("<svg></svg>"),
                                          with("<g id=\"a\"id2=\"b\"/>"),
                                          with("<use xlink:href=\"#a\"/>"),
                                          with("") + with(""),
                                          with("") + "<script/>",
                                          "",
                                          "<html></html>",
                                          "text " + with(""),
                                          with("<g fill=\"u\\72l(x)\"/>"),
                                          with("<g fill=\"&#117;rl(x)\"/>"),
                                          with("<g id=\"a\" id=\"b\"/>"),
                                          "<svg",
                                          "<svg "};
    for (const std::string& svg : others) EXPECT_FALSE(is_plain_svg(svg)) << svg;
    EXPECT_TRUE(is_svg(" <!-- made by x -->\n" + with("<script/>")));
    EXPECT_FALSE(is_svg("<svgx>"));
}

TEST(PageImages, PngSizesAndDamage) {
    const std::string png = small_png().bytes;
    EXPECT_EQ(png_size(png), std::make_pair(5, 3));
    for (std::size_t n = 0; n < png.size(); ++n) EXPECT_THROW(png_size(png.substr(0, n)), InvalidInput) << n;
    for (std::size_t at = 0; at < png.size(); ++at) {
        std::string other = png;
        other[at] = static_cast<char>(other[at] ^ 16);
        EXPECT_THROW(png_size(other), InvalidInput) << at;
    }
}
