// The folder of a model run, read with distrust: anything in it may be missing, damaged or of another make.
#pragma once

#include <algorithm>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/session.h"
#include "vdbgeo/view/report_page.h"

namespace vdbgeo::app {

/// A stage of a run as summary.json has it; texts and numbers that are not there are empty.
struct RunStage {
    std::string name, title, status, error, command;
    std::optional<double> seconds;
    std::vector<std::string> warnings;
    std::optional<std::vector<std::string>> files;  ///< that it left, where the summary lists them
    Json result;                                    ///< an object; empty where there is none

    bool done() const { return status == "done" || status == "reused"; }
    /// False where the summary says that it made no such file.
    bool left(const std::string& file) const {
        return !files || std::find(files->begin(), files->end(), file) != files->end();
    }
};

/// One row of a table of pockets: numbers by the names of the columns.
struct PocketRow {
    std::vector<std::pair<std::string, double>> values;
    std::optional<double> number(const std::string& column) const;
};

class ReportFolder {
 public:
    /// IoError where there is no such folder; InvalidInput where it is none, or has nothing that a report
    /// could be on.
    explicit ReportFolder(const std::string& path);

    /// What summary.json says; an empty object where there is none that can be read.
    const Json& summary() const { return summary_; }
    bool has_summary() const { return summary_.is_object() && !summary_.empty(); }
    const std::vector<RunStage>& stages() const { return stages_; }
    const RunStage* stage(const std::string& name) const;
    /// A text of the summary, empty where it has none.
    std::string text(const char* key) const;

    std::filesystem::path file(const std::string& name) const { return path_ / name; }
    bool has(const std::string& name) const;

    // These give nothing for a file that is not there, and note it where it is damaged.
    std::optional<PagePng> picture(const std::string& name, const std::string& alt);
    std::string svg(const std::string& name);
    std::vector<PocketRow> pockets();
    /// Whatever `read` makes of a file; its InvalidInput, IoError and NumericalError are noted.
    template <class Value>
    std::optional<Value> taken(const std::string& name, const std::function<Value(const std::string&)>& read);

    void note_damage(const std::string& name, const std::string& why);
    /// Files that could not be read, each with the reason; then the stages that are not done, and the files
    /// that a finished run should have left.
    /// `within_run`: the run that makes the page has not ended yet, which is no news.
    PageTerms missing(bool within_run = false) const;
    const PageTerms& damaged() const { return damaged_; }

 private:
    void read_summary();
    PageTerms missing_files() const;

    std::filesystem::path path_;
    Json summary_ = Json::object();
    std::vector<RunStage> stages_;
    PageTerms damaged_;
};

/// A number of a result: of its own, or of the first object in it that has one of that name.
std::optional<double> number_in(const Json& result, const std::string& key);

}  // namespace vdbgeo::app

#include "vdbgeo/core/errors.h"

template <class Value>
std::optional<Value> vdbgeo::app::ReportFolder::taken(const std::string& name,
                                                      const std::function<Value(const std::string&)>& read) {
    if (!has(name)) return {};
    try {
        return read(file(name).string());
    } catch (const InvalidInput& e) {
        note_damage(name, e.what());
    } catch (const IoError& e) {
        note_damage(name, e.what());
    } catch (const NumericalError& e) {
        note_damage(name, e.what());
    }
    return {};
}
