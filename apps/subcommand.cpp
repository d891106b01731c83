#include "apps/subcommand.h"

#include <fmt/format.h>

#include <algorithm>

#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

std::function<void(Session&)> parse(CLI::App& app, const std::vector<std::string>& words) {
    const auto body = find_command(words.at(0)).define(app);
    std::vector<std::string> reversed(words.rbegin(), std::prev(words.rend()));
    try {
        app.parse(std::move(reversed));
    } catch (const CLI::ParseError& e) {
        throw UsageError(fmt::format("{}: {}", words[0], e.what()));
    }
    return body;
}

}  // namespace

Command find_command(const std::string& name) {
    for (const Command& command : all_commands())
        if (command.name == name) return command;
    throw UsageError(fmt::format("there is no command {}", name));
}

void rehearse(const std::vector<std::string>& words, Team* team) {
    CLI::App app;
    const auto body = parse(app, words);
    Session session = Session::rehearsal();
    session.team = team;
    try {
        body(session);
    } catch (const Session::Rehearsed&) {
    }
}

void check_words(const std::vector<std::string>& words) {
    try {
        rehearse(words);
    } catch (const UsageError&) {
        throw;
    } catch (const std::exception&) {  // a file that an earlier stage is still to write
    }
}

Session::Kept run_words(const std::vector<std::string>& words, const std::string& name,
                        const Session& session, Team* team) {
    CLI::App app;
    const auto body = parse(app, words);
    const auto kept = std::make_shared<Session::Kept>();
    Session step = session.step(name, kept);
    step.team = team;
    body(step);
    step.end_stage();
    return *kept;
}

std::string command_line(const std::string& program, const std::vector<std::string>& words) {
    std::string line = program;
    const auto plain = [](unsigned char c) {
        return std::isalnum(c) || c > 127 ||
               std::string("_-+=.,:/@%").find(static_cast<char>(c)) != std::string::npos;
    };
    for (const std::string& word : words) {
        if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) {
            line += " " + word;
            continue;
        }
        line += " '";
        for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
        line += "'";
    }
    return line;
}

}  // namespace vdbgeo::app
