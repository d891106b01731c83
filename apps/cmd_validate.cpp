// vdbgeo validate: the paper's tables of areas, volumes and curvatures, rerun and set beside the paper.
#include <fmt/format.h>

#include <algorithm>

#include "apps/command.h"
#include "apps/validate_tables.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

struct ValidateOptions {
    std::vector<std::string> tables;
    bool quick = false;
};

/// Fixed where the number is near 1, so that digits can be compared with the paper's; else three places.
std::string number(double value, bool error) {
    return error ? fmt::format("{:.3e}", value) : fmt::format("{:.6f}", value);
}

std::string order_text(const std::optional<double>& order) {
    return order ? fmt::format("({:.2f})", *order) : "";
}

/// A table as lines: first what and how, then for each number the paper's, ours, and the theory's.
void say_table(const ValidatedTable& table, Session& session) {
    const bool numbered = std::isdigit(static_cast<unsigned char>(table.name[0])) != 0;
    const bool errors =
        table.name == "5" || table.name == "6" || table.name == "patches" || table.name == "irregular";
    session.say(fmt::format("{}: {}", numbered ? "Table " + table.name : table.name, table.title));
    std::size_t subject = 0, method = 0;
    for (const ValidatedRow& row : table.rows) {
        subject = std::max(subject, row.subject.size());
        method = std::max(method, row.method.size());
    }
    for (const ValidatedRow& row : table.rows) {
        std::string line = fmt::format("  {:<{}}  {:<{}}", row.subject, subject, row.method, method);
        for (const ValidatedValue& v : row.values) {
            line += fmt::format("  {} ", v.name);
            if (v.paper)
                line += fmt::format("paper {}{} ours ", number(*v.paper, errors), order_text(v.paper_order));
            line += number(v.ours, errors) + order_text(v.order);
            if (v.theory) line += " of " + number(*v.theory, errors);
            if (!v.fault.empty()) line += " WORSE";
        }
        session.say(line);
    }
    session.say("");
}

Json value_json(const ValidatedValue& v) {
    Json j{{"name", v.name}, {"ours", v.ours}};
    if (v.paper) j["paper"] = *v.paper;
    if (v.theory) j["theory"] = *v.theory;
    if (v.order) j["order"] = *v.order;
    if (v.paper_order) j["paper_order"] = *v.paper_order;
    j["worse"] = !v.fault.empty();
    if (!v.fault.empty()) j["why"] = v.fault;
    return j;
}

Json table_json(const ValidatedTable& table) {
    Json rows = Json::array();
    for (const ValidatedRow& row : table.rows) {
        Json values = Json::array();
        for (const ValidatedValue& v : row.values) values.push_back(value_json(v));
        rows.push_back({{"subject", row.subject}, {"method", row.method}, {"values", values}});
    }
    return {{"table", table.name}, {"title", table.title}, {"rows", rows}};
}

std::vector<std::string> faults_of(const ValidatedTable& table) {
    std::vector<std::string> faults;
    for (const ValidatedRow& row : table.rows)
        for (const ValidatedValue& v : row.values)
            if (!v.fault.empty())
                faults.push_back(fmt::format("table {}, {}, {}: {} {}", table.name, row.subject, row.method,
                                             v.name, v.fault));
    return faults;
}

void run_validate(const ValidateOptions& o, Session& session) {
    Clock clock;
    Json tables = Json::array();
    std::vector<std::string> faults;
    for (const std::string& name : validated_names()) {
        if (!o.tables.empty() && std::find(o.tables.begin(), o.tables.end(), name) == o.tables.end())
            continue;
        const ValidatedTable table = validated_table(name, o.quick, session.stage("table " + name));
        session.end_stage();
        if (!session.json) say_table(table, session);
        tables.push_back(table_json(table));
        for (std::string& fault : faults_of(table)) faults.push_back(std::move(fault));
    }
    session.result({{"tables", tables}, {"worse", faults}, {"seconds", clock.seconds()}});
    if (!faults.empty())
        throw NumericalError(fmt::format("{} of the figures are worse than asked for; the first: {}",
                                         faults.size(), faults[0]));
    if (!session.json) session.say("no figure is worse than the paper's, no order below what is asked for");
}

}  // namespace

Command validate_command() {
    return {"validate", "Rerun the paper's tables on surfaces that are known, and tell where ours is worse",
            "  vdbgeo validate --table 5 --quick", [](CLI::App& app) {
                auto o = std::make_shared<ValidateOptions>();
                app.add_option(
                       "--table", o->tables,
                       "Only these: 2 3 4 5 6, patches (other types of surface), irregular (uneven meshes), "
                       "maps (spheres through all stages) [all]")
                    ->check(CLI::IsMember(validated_names()).description(""));
                app.add_flag("--quick", o->quick, "Leave out the finest edges (0.0125 Å)");
                return [o](Session& session) { run_validate(*o, session); };
            }};
}

}  // namespace vdbgeo::app
