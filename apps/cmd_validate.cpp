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

/// Errors to four digits; values near 1 with the places that the paper prints.
std::string number(double value, bool error) {
    return error ? fmt::format("{:.3e}", value) : fmt::format("{:.6f}", value);
}

std::string with_order(const std::string& value, const std::optional<double>& order) {
    return value + (order ? fmt::format(" ({:5.2f})", *order) : "");
}

/// Columns of a table: a heading, and one text a row.
struct Column {
    std::string heading;
    std::vector<std::string> cells;
};

std::vector<Column> columns_of(const ValidatedTable& table) {
    const bool errors = table.rows.front().values.front().name.find(" L") != std::string::npos;
    std::vector<Column> columns{{"", {}}, {"", {}}};
    for (const ValidatedRow& row : table.rows) {
        columns[0].cells.push_back(row.subject);
        columns[1].cells.push_back(row.method);
    }
    const auto add = [&](const std::string& heading, const auto& text) {
        columns.push_back({heading, {}});
        for (const ValidatedRow& row : table.rows) columns.back().cells.push_back(text(row));
    };
    for (std::size_t k = 0; k < table.rows.front().values.size(); ++k) {
        const ValidatedValue& first = table.rows.front().values[k];
        if (first.theory)
            add(first.name + ": theory",
                [&](const ValidatedRow& r) { return number(*r.values[k].theory, errors); });
        if (first.paper)
            add(first.theory ? "paper" : first.name + ": paper", [&](const ValidatedRow& r) {
                return with_order(number(*r.values[k].paper, errors), r.values[k].paper_order);
            });
        add(first.theory || first.paper ? "ours" : first.name, [&](const ValidatedRow& r) {
            const ValidatedValue& v = r.values[k];
            return with_order(number(v.ours, errors), v.order) + (v.fault.empty() ? "" : " WORSE");
        });
    }
    return columns;
}

/// Characters on the terminal: bytes that begin one in UTF-8.
std::size_t width_of(const std::string& text) {
    return static_cast<std::size_t>(
        std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

void say_table(const ValidatedTable& table, Session& session) {
    const bool numbered = table.name.size() == 1;
    session.say(fmt::format("{}: {}", numbered ? "Table " + table.name : table.name, table.title));
    const std::vector<Column> columns = columns_of(table);
    std::vector<std::string> lines(table.rows.size() + 1);
    for (const Column& column : columns) {
        std::size_t width = width_of(column.heading);
        for (const std::string& cell : column.cells) width = std::max(width, width_of(cell));
        if (width == 0) continue;
        for (std::size_t r = 0; r < lines.size(); ++r) {
            const std::string& cell = r == 0 ? column.heading : column.cells[r - 1];
            lines[r] += "  " + cell + std::string(width - width_of(cell), ' ');
        }
    }
    for (std::string& line : lines) {
        line.erase(line.find_last_not_of(' ') + 1);
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
        throw NumericalError(
            fmt::format("figures worse than asked for: {}; the first: {}", faults.size(), faults[0]));
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
