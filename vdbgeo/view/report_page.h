// The report: one HTML file that holds a model's pictures, plots, numbers and meshes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

// Everything here is plain text, as people read it, unless it says otherwise: the page escapes it.

/// A PNG file.
struct PagePng {
    std::string bytes;
    int width = 0, height = 0;
    std::string alt;  ///< what can be seen, for those who cannot
};

/// A plot or a picture with what there is to say of it.
struct PageFigure {
    std::string title, caption;
    std::string svg;  ///< the file's text; empty: none
    PagePng image;    ///< shown where there is no SVG
};

struct PageColumn {
    std::string name;
    bool number = true;  ///< set to the right
};

struct PageTable {
    std::string id;  ///< of the element
    std::string caption;
    std::vector<PageColumn> columns;
    std::vector<std::vector<std::string>> rows;
    std::size_t shown = SIZE_MAX;  ///< rows beyond are folded up
};

/// Sections through the middle across one axis, of the same size.
struct PageComparison {
    char axis = 'z';
    PagePng before, after;
};

/// Numbers under a heading.
struct PageNumbers {
    std::string title, text;
    PageTable table;
};

/// A step of the work: what was called, and how it went.
struct PageStage {
    std::string title, status, time;
    std::string command;  ///< as it is typed; empty: none
    std::vector<std::string> remarks;
};

/// Where the viewer's camera goes for a pocket.
struct PagePocket {
    std::uint32_t id = 0;
    Vec3d centre = Vec3d::Zero(), opening = Vec3d::Zero();
    double radius = 0;  ///< Å
};

using PageTerms = std::vector<std::pair<std::string, std::string>>;

/// What a report says. Sections without content are left out.
struct ReportContent {
    std::string title, subtitle;
    std::vector<std::string> summary;  ///< paragraphs
    PageTerms facts;                   ///< the main numbers, each with its unit

    std::optional<PagePng> poster;  ///< stands where the viewer will be
    std::vector<std::string> specimen;
    std::string surface, tets;  ///< as packed_surface and packed_tets give them; empty: none
    std::vector<PagePocket> pocket_places;

    std::vector<std::string> pockets_text;
    PageTable pockets;  ///< the first column is the id

    std::vector<PageComparison> comparisons;
    std::vector<PageFigure> noise, plots, pictures;
    std::vector<PageNumbers> numbers;
    PageTerms glossary;

    std::vector<std::string> how_text;
    std::vector<PageStage> how;
    std::vector<PageTable> how_tables;
    PageTerms citations;  ///< what is cited, and its BibTeX
    PageTerms missing;    ///< what is not there, and why
};

/// The page: HTML 5 in one piece that fetches nothing. Readable without its script. The same bytes for the
/// same content.
std::string report_html(const ReportContent& content);

}  // namespace vdbgeo
