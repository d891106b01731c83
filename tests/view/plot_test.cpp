// Drawings as pixels and as SVG; marks, legends, logarithmic counts, the plane.
#include "vdbgeo/view/plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/plot_plane.h"
#include "vdbgeo/view/svg.h"

using namespace vdbgeo;

namespace {

const Vec3f red{1, 0, 0}, green{0, 1, 0};

bool is(const Image& image, int x, int y, const Vec3f& colour) {
    for (int c = 0; c < 3; ++c)
        if (image.at(x, y)[c] != to_byte(colour[c])) return false;
    return true;
}

template <class Shape>
std::vector<Shape> all(const Drawing& drawing) {
    std::vector<Shape> found;
    for (const Drawing::Shape& shape : drawing.shapes)
        if (const Shape* s = std::get_if<Shape>(&shape)) found.push_back(*s);
    return found;
}

const Drawing::Text* find_text(const std::vector<Drawing::Text>& texts, const std::string& text) {
    for (const Drawing::Text& t : texts)
        if (t.text == text) return &t;
    return nullptr;
}

std::size_t count(const std::string& text, const std::string& part) {
    std::size_t n = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
    return n;
}

Curve curve(const std::string& name, const Vec3f& colour, const std::function<double(double)>& y) {
    Curve c{name, {}, {}, colour};
    for (int i = 0; i <= 200; ++i) {
        c.x.push_back(i / 200.0);
        c.y.push_back(y(i / 200.0));
    }
    return c;
}

/// The words of a curve in the legend, as a box around them and their sample.
Drawing::Boxes::Box legend_box(const Drawing& drawing, const std::string& name) {
    const auto texts = all<Drawing::Text>(drawing);
    const Drawing::Text* text = find_text(texts, name);
    EXPECT_TRUE(text) << name;
    if (!text) return {0, 0, 0, 0};
    const double x = text->position.x(), y = text->position.y();
    return {x - 2.4 * text->size, y - 0.8 * text->size, x + text_width(name, text->size),
            y + 0.2 * text->size};
}

/// Points of the curves (not of the legend's samples) that lie in a box.
int points_in(const Drawing& drawing, const Drawing::Boxes::Box& box) {
    int n = 0;
    for (const auto& lines : all<Drawing::Lines>(drawing))
        for (const auto& chain : lines.chains)
            if (chain.size() > 2 && lines.role == Drawing::Role::own)
                for (const Vec2d& p : chain)
                    n += p.x() > box.x0 && p.x() < box.x1 && p.y() > box.y0 && p.y() < box.y1;
    return n;
}

}  // namespace

TEST(Drawing, IsPaintedInItsOrder) {
    Drawing d;
    d.width = 40, d.height = 30;
    d.paper = Vec3f(0, 0, 1);
    d.shapes.push_back(Drawing::Boxes{{{5, 5, 20, 25}, {25, 5, 35, 10}}, red, Drawing::Role::own, 1});
    d.shapes.push_back(Drawing::Lines{{{{10, 15}, {30, 15}}}, 4, green, Drawing::Role::own});
    d.shapes.push_back(Drawing::Boxes{{{0, 26, 40, 28}}, red, Drawing::Role::own, 0.5});
    const Image image = rasterise(d);
    EXPECT_TRUE(is(image, 7, 7, red));
    EXPECT_TRUE(is(image, 30, 7, red));
    EXPECT_TRUE(is(image, 15, 15, green));
    EXPECT_TRUE(is(image, 25, 14, green));
    EXPECT_TRUE(is(image, 22, 7, {0, 0, 1}));
    EXPECT_TRUE(is(image, 3, 27, {0.5f, 0, 0.5f}));
    EXPECT_THROW(rasterise(Drawing()), InvalidInput);
}

TEST(Drawing, TextIsThatOfTheStrokeFont) {
    Drawing d;
    d.width = 200, d.height = 60;
    d.shapes.push_back(
        Drawing::Text{{100, 40}, "3σ Å", 30, red, TextAlign::centre, false, Drawing::Role::ink});
    Image expected(200, 60);
    draw_text(expected, {100, 40}, "3σ Å", 30, red, TextAlign::centre);
    EXPECT_EQ(rasterise(d).pixels, expected.pixels);
}

TEST(Svg, HasTheThemesClassesAndRealText) {
    PlotOptions options;
    options.title = "Angles";
    options.x_label = "angle (°)";
    const std::string svg = svg_text(plot_histogram({1, 4, 2}, 0, 3, options));
    EXPECT_EQ(svg.rfind("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 1000 640\" width=\"1000\" "
                        "height=\"640\" role=\"img\" aria-label=\"Angles\"",
                        0),
              0u)
        << svg.substr(0, 200);
    EXPECT_NE(svg.find("<title>Angles</title>"), std::string::npos);
    EXPECT_NE(svg.find(">angle (°)</text>"), std::string::npos);
    for (const char* name : {"ink-text", "ink-line", "grid", "paper"})
        EXPECT_GE(count(svg, std::string("class=\"") + name + "\""), 1u) << name;
    EXPECT_EQ(count(svg, "<text"), count(svg, "class=\"ink-text\""));
    EXPECT_NE(svg.find("font-family=\"sans-serif\""), std::string::npos);
    EXPECT_EQ(svg.substr(svg.size() - 7), "</svg>\n");
}

TEST(Svg, EscapesWhatXmlCannotHold) {
    Drawing d;
    d.width = d.height = 200;
    d.title = "a<b> & \"c\"";
    for (const char* text : {"x<y>&\"z\"", "bad \xff\xc3 end", "bell \x07", "\xed\xa0\x80",
                             "σ \xf0\x9f\x98\x80", "\xef\xbf\xbf"})
        d.shapes.push_back(Drawing::Text{{1, 1}, text});
    const std::string svg = svg_text(d);
    EXPECT_NE(svg.find("aria-label=\"a&lt;b&gt; &amp; &quot;c&quot;\""), std::string::npos) << svg;
    EXPECT_NE(svg.find(">x&lt;y&gt;&amp;&quot;z&quot;<"), std::string::npos) << svg;
    EXPECT_NE(svg.find(">bad \ufffd\ufffd end<"), std::string::npos) << svg;
    EXPECT_NE(svg.find(">bell \ufffd<"), std::string::npos) << svg;
    EXPECT_NE(svg.find(">\ufffd\ufffd\ufffd<"), std::string::npos) << svg;  // a surrogate, and U+FFFF
    EXPECT_NE(svg.find(">σ \xf0\x9f\x98\x80<"), std::string::npos) << svg;
    for (const char c : svg) EXPECT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 0x20);
}

TEST(Svg, TurnedTextAndRounding) {
    Drawing d;
    d.width = d.height = 200;
    d.shapes.push_back(
        Drawing::Text{{10.126, 20}, "up", 12, red, TextAlign::right, true, Drawing::Role::own});
    d.shapes.push_back(Drawing::Lines{{{{-0.001, 1.5}, {3, 1e3}}}, 2, red, Drawing::Role::own});
    const std::string svg = svg_text(d);
    EXPECT_NE(svg.find("<text x=\"10.13\" y=\"20\" font-size=\"12\" text-anchor=\"end\" "
                       "transform=\"rotate(-90 10.13 20)\" fill=\"#ff0000\">up</text>"),
              std::string::npos)
        << svg;
    EXPECT_NE(svg.find("d=\"M0 1.5L3 1000\""), std::string::npos) << svg;
}

TEST(Svg, IsWrittenWholeOrNotAtAll) {
    test::TempFolder folder;
    const Drawing d = plot_histogram({1, 2}, 0, 1);
    write_svg(d, folder / "a.svg");
    EXPECT_EQ(test::read_bytes(folder / "a.svg"), svg_text(d));
    EXPECT_THROW(write_svg(d, folder / "none/a.svg"), IoError);
    EXPECT_THROW(write_svg(d, "/dev/full"), IoError);
}

TEST(Plot, TheDarkThemeChangesColoursAlone) {
    PlotOptions light, dark;
    dark.theme = Theme::dark();
    light.title = dark.title = "t";
    const Drawing a = plot_histogram({1, 2}, 0, 1, light), b = plot_histogram({1, 2}, 0, 1, dark);
    ASSERT_EQ(a.shapes.size(), b.shapes.size());
    EXPECT_EQ(b.paper, Theme::dark().paper);
    EXPECT_TRUE(is(rasterise(b), 2, 2, Theme::dark().paper));
    for (const auto& t : all<Drawing::Text>(b)) EXPECT_EQ(t.colour, Theme::dark().ink);
    // Without the colours they are the same.
    const auto plain = [](std::string svg) {
        for (std::size_t at = svg.find("=\"#"); at != std::string::npos; at = svg.find("=\"#", at + 1))
            svg.replace(at + 3, 6, "000000");
        return svg;
    };
    EXPECT_NE(svg_text(a), svg_text(b));
    EXPECT_EQ(plain(svg_text(a)), plain(svg_text(b)));
}

TEST(Plot, AMarkStandsAtItsValue) {
    PlotOptions options;
    options.marks = {{7.5, "here"}, {11, "beyond"}};
    const Drawing d = plot_histogram(std::vector<double>(10, 1), 0, 10, options);
    const auto bars = all<Drawing::Boxes>(d);
    ASSERT_EQ(bars.size(), 1u);
    const double middle = (bars[0].boxes[7].x0 + bars[0].boxes[7].x1) / 2;  // the bar from 7 to 8
    int found = 0;
    for (const auto& lines : all<Drawing::Lines>(d))
        for (const auto& c : lines.chains)
            if (c.size() == 2 && c[0].x() == c[1].x() && std::abs(c[0].x() - middle) < 0.01 &&
                std::abs(c[0].y() - c[1].y()) > 300)
                ++found;
    EXPECT_EQ(found, 1);
    const auto texts = all<Drawing::Text>(d);
    ASSERT_TRUE(find_text(texts, "here"));
    EXPECT_NEAR(find_text(texts, "here")->position.x(), middle, 0.01);
    EXPECT_LT(find_text(texts, "here")->position.y(), bars[0].boxes[7].y0);  // above the bars
    EXPECT_FALSE(find_text(texts, "beyond"));
    options.marks = {{std::nan(""), ""}};
    EXPECT_THROW(plot_histogram({1}, 0, 1, options), InvalidInput);
}

TEST(Plot, LogarithmicCountsHaveBarsByPowersOfTen) {
    PlotOptions options;
    options.logarithmic_counts = true;
    const Drawing d = plot_histogram({1, 10, 0, 100, 1000}, 0, 5, options);
    const auto bars = all<Drawing::Boxes>(d).at(0).boxes;
    ASSERT_EQ(bars.size(), 4u);  // none for 0
    const double one = bars[0].y1 - bars[0].y0, step = bars[0].y0 - bars[1].y0;
    EXPECT_GT(one, 5);  // a single voxel is seen
    EXPECT_NEAR(bars[1].y0 - bars[2].y0, step, 0.01);
    EXPECT_NEAR(bars[2].y0 - bars[3].y0, step, 0.01);
    const auto texts = all<Drawing::Text>(d);
    for (const char* label : {"1", "10", "10²", "10³"}) EXPECT_TRUE(find_text(texts, label)) << label;
    EXPECT_EQ(all<Drawing::Boxes>(plot_histogram({0, 0}, 0, 1, options)).at(0).boxes.size(), 0u);
    // More powers than there is room for: the highest are shown, bars below them not.
    EXPECT_EQ(all<Drawing::Boxes>(plot_histogram({1e-9, 1e9}, 0, 1, options)).at(0).boxes.size(), 1u);
}

TEST(Plot, TheLegendCoversNoCurve) {
    const auto peak = [](double at) {
        return [at](double x) { return std::exp(-500 * (x - at) * (x - at)); };
    };
    // On the left, on the right, and everywhere.
    const std::vector<std::vector<Curve>> cases{
        {curve("left one", red, peak(0.1))},
        {curve("right one", red, peak(0.9)), curve("also right", green, peak(0.8))},
        {curve("everywhere", red, [](double x) { return 1 + std::sin(200 * x); }),
         curve("and beside", green, [](double x) { return 1 - std::sin(200 * x); })}};
    for (const auto& curves : cases) {
        const Drawing d = plot_curves(curves, false);
        for (const Curve& c : curves) {
            const auto box = legend_box(d, c.name);
            EXPECT_EQ(points_in(d, box), 0) << c.name;
            EXPECT_GE(box.x0, 0);
            EXPECT_LE(box.x1, d.width);
            EXPECT_GE(box.y0, 0);
        }
    }
    EXPECT_GT(legend_box(plot_curves(cases[0], false), "left one").x0, 500);
    // Names longer than the plot is wide are made smaller, and many have rows of their own.
    std::vector<Curve> many;
    for (int i = 0; i < 12; ++i)
        many.push_back(curve(std::string(90, 'm') + std::to_string(i), red, [](double x) { return x; }));
    const Drawing d = plot_curves(many, false);
    EXPECT_GT(d.height, 640);
    double last = 0;
    for (const Curve& c : many) {
        const auto box = legend_box(d, c.name);
        EXPECT_LE(box.x1, d.width);
        EXPECT_GE(box.y0, last);
        EXPECT_EQ(points_in(d, box), 0);
        last = box.y1;
    }
}

namespace {

PlaneDensity diagonal() {
    PlaneDensity density{4, std::vector<double>(16, 0.0), -1, 1};
    density.values[0] = 100;            // the cell of the lowest values
    density.values[2 * 4 + 3] = 0.001;  // x in 0.5…1, y in 0…0.5
    density.values[15] = 1;
    return density;
}

}  // namespace

TEST(PlotPlane, CellsLieWhereTheirValuesAre) {
    PlanePlot plane;
    plane.bar_label = "share";
    plane.lines = {{{-1, -1}, {1, 1}}};
    plane.names = {{"here", {{-0.5, 0.5}}}, {"too long for any place", {{0.99, 0.99}}}};
    const Drawing d = plot_plane(diagonal(), plane);
    const auto boxes = all<Drawing::Boxes>(d);
    const auto axes = all<Drawing::Lines>(d).at(0).chains.at(0);  // the diagonal: corners of the plane
    const Vec2d low = axes[0], high = axes[1];
    EXPECT_NEAR(high.x() - low.x(), low.y() - high.y(), 1e-9);
    const double quarter = (high.x() - low.x()) / 4;
    const auto has = [&](double x0, double y0) {
        for (const auto& b : boxes)
            for (const auto& box : b.boxes)
                if (std::abs(box.x0 - x0) <= 1 && std::abs(box.y1 - y0) <= 1 &&
                    std::abs(box.x1 - box.x0 - quarter) <= 1)
                    return true;
        return false;
    };
    EXPECT_TRUE(has(low.x(), low.y()));
    EXPECT_TRUE(has(low.x() + 3 * quarter, low.y() - 2 * quarter));
    EXPECT_TRUE(has(low.x() + 3 * quarter, low.y() - 3 * quarter));
    EXPECT_FALSE(has(low.x() + quarter, low.y()));
    const auto texts = all<Drawing::Text>(d);
    ASSERT_TRUE(find_text(texts, "here"));
    EXPECT_NEAR(find_text(texts, "here")->position.x(), low.x() + quarter, 0.01);
    EXPECT_FALSE(find_text(texts, "too long for any place"));
    EXPECT_TRUE(find_text(texts, "share"));
    EXPECT_TRUE(find_text(texts, "10²"));  // of the colour bar: three powers of ten below 100
    EXPECT_TRUE(find_text(texts, "10⁻¹"));
    EXPECT_FALSE(find_text(texts, "10³"));
}

TEST(PlotPlane, NamesHideAsLittleAsTheyCan) {
    PlanePlot plane;
    PlaneDensity density{40, std::vector<double>(1600, 0.0), 0, 1};
    for (std::size_t i = 0; i < 800; ++i) density.values[i] = 1;  // the lower half
    plane.names = {{"word", {{0.5, 0.25}, {0.5, 0.75}}}, {"other", {{0.5, 0.25}, {0.5, 0.76}}}};
    const Drawing d = plot_plane(density, plane);
    const auto texts = all<Drawing::Text>(d);
    ASSERT_TRUE(find_text(texts, "word") && find_text(texts, "other"));
    // The second keeps clear of the first, and so has to hide something.
    EXPECT_LT(find_text(texts, "word")->position.y() + 50, find_text(texts, "other")->position.y());
}

TEST(PlotPlane, RefusesWhatIsNoPlane) {
    PlaneDensity torn = diagonal(), negative = diagonal(), empty = diagonal();
    torn.values.pop_back();
    negative.values[3] = -1;
    empty.high = empty.low;
    for (const PlaneDensity& density : {torn, negative, empty, PlaneDensity()})
        EXPECT_THROW(plot_plane(density, {}), InvalidInput);
    PlanePlot plane;
    plane.powers = 0;
    EXPECT_THROW(plot_plane(diagonal(), plane), InvalidInput);
    PlaneDensity nothing{3, std::vector<double>(9, 0.0), 0, 1};
    EXPECT_NO_THROW(rasterise(plot_plane(nothing, {})));
    PlotOptions tiny;
    tiny.width = tiny.height = 160;
    EXPECT_NO_THROW(rasterise(plot_plane(diagonal(), {}, tiny)));
}
