// vdbgeo report: one page for the folder of a model.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/report_content.h"
#include "apps/stages.h"
#include "vdbgeo/view/page_assets.h"

namespace vdbgeo::app {
namespace {

Json terms_json(const PageTerms& terms) {
    Json list = Json::array();
    for (const auto& [what, why] : terms) list.push_back({{"what", what}, {"why", why}});
    return list;
}

void run_report(const ReportOptions& o, Session& session) {
    if (o.out == "-") take_output(session);
    check_folder_of(o.out);
    Clock clock;
    Report report;
    const std::string out = write_report(o, session, report);
    session.end_stage();
    for (const auto& [file, why] : report.damaged)
        session.warn(fmt::format("{}/{}: {}", o.folder, file, why));
    if (!have_page()) session.warn("this build has no script for the page: nothing in it can be turned");
    for (const std::string& note : report.notes) session.say(note);
    session.say(fmt::format("{}: {:.2f} MB", out == "-" ? "page" : out,
                            static_cast<double>(report.html.size()) / 1e6));
    session.result({{"out", out},
                    {"bytes", report.html.size()},
                    {"faces", report.faces},
                    {"faces_full", report.faces_full},
                    {"tets", report.tets},
                    {"tets_full", report.tets_full},
                    {"pockets", report.pockets},
                    {"viewer", have_page()},
                    {"notes", report.notes},
                    {"missing", terms_json(report.missing)},
                    {"seconds", {{"all", clock.seconds()}}}});
}

}  // namespace

Command report_command() {
    return {"report", "One HTML page with the model, plots, pictures and numbers of a folder that model made",
            "  vdbgeo report groel --title GroEL", [](CLI::App& app) {
                auto o = std::make_shared<ReportOptions>();
                auto size = std::make_shared<std::string>();
                app.add_option("folder", o->folder, "Folder of a model run, finished or not")->required();
                app.add_option("-o,--out", o->out,
                               "Page to write, - for standard output [report.html in the folder]");
                app.add_option("--title", o->title, "Heading of the page [the map's name]");
                app.add_option("--faces", o->faces, "Simplify the surface for the page to this many faces")
                    ->capture_default_str();
                app.add_option("--tets", o->tets, "Fill it for the page with at most this many tetrahedra")
                    ->capture_default_str();
                app.add_option(
                    "--max-size", *size,
                    "Size of the page in bytes, such as 5M: what does not fit is made coarser [10 million]");
                return [o, size](Session& session) {
                    if (!size->empty()) o->max_bytes = parse_bytes("--max-size", *size);
                    check_usage(*o);
                    run_report(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
