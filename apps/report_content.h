// From the folder of a model run to the content of its report.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/report_folder.h"
#include "apps/report_mesh.h"
#include "apps/session.h"
#include "vdbgeo/view/report_page.h"

namespace vdbgeo::app {

struct ReportOptions {
    std::string folder;
    std::string out;                       ///< empty: report.html in the folder
    std::string title;                     ///< empty: from the map's name, else the folder's
    std::uint64_t faces = 200'000;         ///< of the surface on the page
    std::uint64_t tets = 200'000;          ///< on the page
    std::uint64_t max_bytes = 10'000'000;  ///< of the page
    /// Called by the run itself, as its last stage: that it has not ended yet is no news.
    bool within_run = false;

    void check() const;
};

struct Report {
    std::string html;
    std::uint64_t faces = 0, faces_full = 0, tets = 0, tets_full = 0, pockets = 0;
    std::vector<std::string> notes;  ///< what was left out or made smaller for the page's size
    PageTerms damaged, missing;
};

/// Reads what the folder has and makes the page. What is damaged is told on the page, and in the report. The
/// page is at most max_bytes long: surface and tetrahedra are halved, the larger first, down to a few
/// thousand, then left out, then pictures, the largest first. The same files and options, the same bytes.
///
/// Errors: IoError where there is no such folder, InvalidInput where there is nothing in it to report on, or
/// where a page of words alone is longer than max_bytes.
Report make_report(const ReportOptions& options, Session& session);

/// make_report, and writes the page. Returns where it is.
std::string write_report(const ReportOptions& options, Session& session, Report& report);

}  // namespace vdbgeo::app
