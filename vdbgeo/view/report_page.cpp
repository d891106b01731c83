#include "vdbgeo/view/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/page_assets.h"
#include "vdbgeo/view/page_images.h"
#include "vdbgeo/view/page_text.h"

namespace vdbgeo {
namespace {

/// Nothing is fetched, and the page's own script and style are the only ones.
constexpr const char* policy =
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

std::string paragraph(const std::string& text, const char* kind = "") {
    return fmt::format("<p{}>{}</p>\n", *kind ? fmt::format(" class=\"{}\"", kind) : "", html_text(text));
}

std::string paragraphs(const std::vector<std::string>& texts) {
    std::string html;
    for (const std::string& text : texts) html += paragraph(text);
    return html;
}

std::string terms(const PageTerms& list, const char* kind, const char* item = "term") {
    std::string html = fmt::format("<dl class=\"{}\">\n", kind);
    for (const auto& [term, text] : list)
        html += fmt::format("<div class=\"{}\"><dt>{}</dt><dd>{}</dd></div>\n", item, html_text(term),
                            html_text(text));
    return html + "</dl>\n";
}

std::string image(const PagePng& png, const char* kind = "") {
    return fmt::format("<img{} width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\">",
                       *kind ? fmt::format(" class=\"{}\"", kind) : "", png.width, png.height,
                       html_text(png.alt), base64(png.bytes));
}

std::string copy_button(const std::string& id, const char* what) {
    return fmt::format("<button type=\"button\" class=\"copy\" data-copy=\"{}\">Copy {}</button>\n",
                       html_text(id), what);
}

std::string rows_html(const PageTable& table, std::size_t begin, std::size_t end, bool pockets) {
    std::string html = "<tbody>\n";
    for (std::size_t r = begin; r < end; ++r) {
        const auto& row = table.rows[r];
        html += pockets && !row.empty() ? fmt::format("<tr data-pocket=\"{}\">", html_text(row[0])) : "<tr>";
        for (std::size_t c = 0; c < row.size(); ++c) {
            const bool number = c < table.columns.size() && table.columns[c].number;
            const std::string text = html_text(row[c]);
            if (c == 0)
                html += fmt::format("<th scope=\"row\"{}>{}</th>", number ? " class=\"number\"" : "", text);
            else
                html += fmt::format("<td{}>{}</td>",
                                    !number             ? ""
                                    : text.size() <= 48 ? " class=\"number\""
                                                        : " class=\"number words\"",
                                    text);
        }
        html += "</tr>\n";
    }
    return html + "</tbody>\n";
}

std::string table_part(const PageTable& table, const std::string& id, const std::string& caption,
                       std::size_t begin, std::size_t end, bool pockets) {
    std::string html = fmt::format("<table class=\"data\" id=\"{}\">\n", html_text(id));
    if (!caption.empty()) html += fmt::format("<caption>{}</caption>\n", html_text(caption));
    html += "<thead><tr>";
    for (const PageColumn& c : table.columns)
        html += fmt::format("<th scope=\"col\"{}>{}</th>", c.number ? " class=\"number\"" : "",
                            html_text(c.name));
    return html + "</tr></thead>\n" + rows_html(table, begin, end, pockets) + "</table>\n";
}

/// Tables are wide: they scroll in a box of their own.
std::string table_html(const PageTable& table, bool pockets = false) {
    const std::size_t all = table.rows.size(), shown = std::min(table.shown, all);
    std::string html = copy_button(table.id, "table");
    html += "<div class=\"scroll\">\n" + table_part(table, table.id, table.caption, 0, shown, pockets) +
            "</div>\n";
    if (shown == all) return html;
    return html + fmt::format(
                      "<details><summary>{} more</summary>\n{}<div class=\"scroll\">\n{}</div>\n"
                      "</details>\n",
                      all - shown, copy_button(table.id + "-more", "table"),
                      table_part(table, table.id + "-more", "", shown, all, pockets));
}

/// The SVG itself, with ids of its own so that they mean nothing else on the page; where it has more than
/// shapes, as an image, in which nothing of it can act.
std::string svg_html(const std::string& svg, const std::string& title, std::size_t number) {
    if (!is_plain_svg(svg))
        return fmt::format("<img alt=\"{}\" src=\"data:image/svg+xml;base64,{}\">", html_text(title),
                           base64(svg));
    std::string own = svg.substr(svg.find("<svg"));
    const std::string prefix = fmt::format("plot{}-", number);
    for (const std::string mark : {" id=\"", "url(#"})
        for (std::size_t at = 0; (at = own.find(mark, at)) != std::string::npos;
             at += mark.size() + prefix.size())
            own.insert(at + mark.size(), prefix);
    return own;
}

std::string figure_html(const PageFigure& figure, const char* kind, std::size_t number) {
    const std::string body =
        figure.svg.empty() ? image(figure.image) : svg_html(figure.svg, figure.title, number);
    return fmt::format(
        "<figure class=\"{}\">\n{}\n<figcaption><strong>{}.</strong> {}</figcaption>\n</figure>\n", kind,
        body, html_text(figure.title), html_text(figure.caption));
}

std::string comparison_html(const PageComparison& c) {
    return fmt::format("<div class=\"compare\" data-axis=\"{}\">{}{}</div>\n", c.axis,
                       image(c.before, "before"), image(c.after, "after"));
}

std::string stage_html(const PageStage& stage, std::size_t number) {
    std::string html = "<li>\n<h3>" + html_text(stage.title);
    const std::string apart = stage.status.empty() || stage.time.empty() ? "" : ", ";
    if (!stage.status.empty() || !stage.time.empty())
        html += " <small>" + html_text(stage.status) + apart + html_text(stage.time) + "</small>";
    html += "</h3>\n";
    if (!stage.command.empty()) {
        const std::string id = fmt::format("command-{}", number);
        html += fmt::format("<pre id=\"{}\">{}</pre>\n", id, html_text(stage.command)) +
                copy_button(id, "command");
    }
    for (const std::string& remark : stage.remarks) html += paragraph(remark, "remark");
    return html + "</li>\n";
}

std::string hex(const Vec3f& colour) {
    std::string text = "#";
    for (int a = 0; a < 3; ++a)
        text += fmt::format("{:02x}", std::lround(255 * std::clamp(colour[a], 0.0f, 1.0f)));
    return text;
}

std::string colormaps_json() {
    std::string json = "{";
    for (const std::string& name : Colormap::names()) {
        const Colormap map(name);
        const int count = map.categories() > 0 ? map.categories() : 256;
        json += fmt::format("{}{}:[", json.size() > 1 ? "," : "", json_string(name));
        for (int i = 0; i < count; ++i)
            json += fmt::format("{}\"{}\"", i ? "," : "",
                                hex(map.categories() > 0 ? map.category(i) : map.colour(i / 255.0)));
        json += "]";
    }
    return json + "}";
}

std::string vector_json(const Vec3d& v) {
    return fmt::format("[{},{},{}]", json_number(v.x()), json_number(v.y()), json_number(v.z()));
}

std::string data_json(const ReportContent& c) {
    std::string json = fmt::format(
        R"({{"version":1,"title":{},"unit":"Å","colormaps":{},"surface":{},"tets":{})", json_string(c.title),
        colormaps_json(), c.surface.empty() ? "null" : c.surface, c.tets.empty() ? "null" : c.tets);
    json += R"(,"pockets":[)";
    for (const PagePocket& p : c.pocket_places)
        json += fmt::format(R"({}{{"id":{},"centre":{},"opening":{},"radius":{}}})",
                            json.back() == '[' ? "" : ",", p.id, vector_json(p.centre),
                            vector_json(p.opening), json_number(p.radius));
    return json + R"(],"views":{"up":[0,0,1]}})";
}

struct Section {
    const char *id, *title;
    std::string html;
};

std::string pockets_html(const ReportContent& c) {
    std::string html = paragraphs(c.pockets_text);
    if (have_page() && !c.surface.empty() && !c.pocket_places.empty())
        html += paragraph("Choose a row to see the pocket in the view above.", "hint");
    if (!c.pockets.rows.empty()) html += table_html(c.pockets, true);
    return html;
}

std::string specimen_html(const ReportContent& c) {
    if (!c.poster && c.surface.empty() && c.tets.empty()) return {};
    std::string html = "<div id=\"viewer\" class=\"viewer\">";
    if (c.poster) html += image(*c.poster, "poster");
    html += "</div>\n";
    if (!c.surface.empty() || !c.tets.empty())
        html += have_page()
                    ? "<noscript><p>The picture above can be turned, coloured and cut open where scripts are "
                      "allowed.</p></noscript>\n"
                    : "<p>This page was made by a build without the three-dimensional viewer.</p>\n";
    return html + paragraphs(c.specimen);
}

std::string noise_html(const ReportContent& c) {
    if (c.comparisons.empty() && c.noise.empty()) return {};
    std::string html = c.comparisons.empty() ? ""
                                             : paragraph(
                                                   "Sections through the middle of the map, before and after "
                                                   "the removal of noise, in the same greys: "
                                                   "what is dense is bright. Edges should stay where they "
                                                   "are while the speckle between them goes.");
    for (const PageComparison& one : c.comparisons) html += comparison_html(one);
    for (std::size_t i = 0; i < c.noise.size(); ++i) html += figure_html(c.noise[i], "plot", 1000 + i);
    return html;
}

std::string figures_html(const std::vector<PageFigure>& figures, const char* kind) {
    std::string html;
    for (std::size_t i = 0; i < figures.size(); ++i) html += figure_html(figures[i], kind, i + 1);
    return html;
}

std::string numbers_html(const ReportContent& c) {
    std::string html;
    for (const PageNumbers& n : c.numbers)
        html += fmt::format("<h3>{}</h3>\n", html_text(n.title)) + (n.text.empty() ? "" : paragraph(n.text)) +
                table_html(n.table);
    if (!c.glossary.empty() && !html.empty())
        html += "<h3 id=\"glossary\">Words</h3>\n" + terms(c.glossary, "glossary");
    return html;
}

std::string how_html(const ReportContent& c) {
    std::string html = paragraphs(c.how_text);
    if (!c.how.empty()) html += "<ol class=\"stages\">\n";
    for (std::size_t i = 0; i < c.how.size(); ++i) html += stage_html(c.how[i], i + 1);
    if (!c.how.empty()) html += "</ol>\n";
    for (PageTable table : c.how_tables) {
        const std::string caption = std::exchange(table.caption, "");
        html +=
            "<details>\n<summary>" + html_text(caption) + "</summary>\n" + table_html(table) + "</details>\n";
    }
    return html;
}

/// "doi:10.…" in a text becomes a link.
std::string with_links(const std::string& text) {
    const std::size_t at = text.find("doi:");
    if (at == std::string::npos) return html_text(text);
    const std::size_t end = std::min(text.find_first_of(" ,;)", at), text.size());
    const std::string doi = html_text(text.substr(at + 4, end - at - 4));
    return html_text(text.substr(0, at)) +
           fmt::format("<a href=\"https://doi.org/{}\">doi:{}</a>", doi, doi) + html_text(text.substr(end));
}

std::string cite_html(const ReportContent& c) {
    std::string html;
    for (std::size_t i = 0; i < c.citations.size(); ++i) {
        const std::string id = fmt::format("bibtex-{}", i + 1);
        html += fmt::format("<p>{}</p>\n<pre id=\"{}\">{}</pre>\n", with_links(c.citations[i].first), id,
                            html_text(c.citations[i].second)) +
                copy_button(id, "BibTeX");
    }
    return html;
}

std::vector<Section> sections_of(const ReportContent& c) {
    std::vector<Section> all{
        {"summary", "Summary",
         paragraphs(c.summary) + (c.facts.empty() ? "" : terms(c.facts, "facts", "card"))},
        {"specimen", "The specimen", specimen_html(c)},
        {"pockets", "Pockets", pockets_html(c)},
        {"noise", "Noise", noise_html(c)},
        {"plots", "Plots", figures_html(c.plots, "plot")},
        {"pictures", "Pictures", figures_html(c.pictures, "picture")},
        {"numbers", "Numbers", numbers_html(c)},
        {"how", "How it was made", how_html(c)},
        {"cite", "How to cite", cite_html(c)},
        {"missing", "What is missing", c.missing.empty() ? "" : terms(c.missing, "missing")}};
    all.erase(std::remove_if(all.begin(), all.end(), [](const Section& s) { return s.html.empty(); }),
              all.end());
    return all;
}

}  // namespace

std::string report_html(const ReportContent& content) {
    const std::vector<Section> sections = sections_of(content);
    std::string html = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<meta name=\"generator\" content=\"vdbgeo\">\n<title>{}</title>\n<link rel=\"icon\" "
        "href=\"data:,\">\n"
        "<style>{}</style>\n</head>\n<body>\n<header class=\"top\">\n<h1>{}</h1>\n",
        policy, html_text(content.title), page_style(), html_text(content.title));
    if (!content.subtitle.empty()) html += paragraph(content.subtitle, "subtitle");
    html += "<nav aria-label=\"Sections\">\n";
    for (const Section& s : sections) html += fmt::format("<a href=\"#{}\">{}</a>\n", s.id, s.title);
    html += "</nav>\n</header>\n<main>\n";
    for (const Section& s : sections)
        html += fmt::format(
            "<section id=\"{}\" aria-labelledby=\"{}-title\">\n<h2 id=\"{}-title\">{}</h2>\n{}</section>\n",
            s.id, s.id, s.id, s.title, s.html);
    html += "</main>\n";
    html += "<script type=\"application/json\" id=\"vdbgeo-data\">" + data_json(content) + "</script>\n";
    if (have_page()) html += fmt::format("<script>{}</script>\n", page_script());
    return html + "</body>\n</html>\n";
}

}  // namespace vdbgeo
