#include "apps/team_lines.h"

#include <exception>

#include "apps/subcommand.h"
#include "vdbgeo/core/run_together.h"

namespace vdbgeo::app {
namespace {

using Words = std::vector<std::string>;

/// What the first tells the others: a line to run with it; or that this was all, which may be for a command
/// line that made no sense.
struct Word {
    bool end = false;
    Words line;
    std::string name, usage_error;

    std::string text() const {
        return Json{{"end", end}, {"line", line}, {"name", name}, {"usage_error", usage_error}}.dump(
            -1, ' ', false, Json::error_handler_t::replace);
    }
    static Word parse(const std::string& text) {
        const Json j = Json::parse(text);
        return {j["end"].get<bool>(), j["line"].get<Words>(), j["name"].get<std::string>(),
                j["usage_error"].get<std::string>()};
    }
};

/// The first says it, and all know.
Word pass_on(Team& team, const Word& word) {
    team.rest_until_all_come();
    const std::string text = team.rank() == 0 ? word.text() : "";
    const auto all = team.gather({text.begin(), text.end()});
    return Word::parse({all[0].begin(), all[0].end()});
}

/// By the command's own word, on its command line alone.
bool can_be_shared(const Words& words, Team& team) {
    if (words[0] != "denoise" && words[0] != "surface") return false;
    try {
        check_words(words, &team);
        return true;
    } catch (const UsageError&) {
        return false;
    }
}

void follow(Session& session) {
    Team& team = *session.team;
    for (;;) {
        const Word word = pass_on(team, {});
        if (!word.usage_error.empty()) throw UsageError(word.usage_error);
        if (word.end) return run_together(team, [] {});
        run_words(word.line, word.name, session, &team);
    }
}

}  // namespace

void lead_or_follow(Session& session, const std::function<void(const RunLine& run)>& body) {
    Team* const team = session.team;
    if (!team)
        return body(
            [&](const Words& words, const std::string& name) { return run_words(words, name, session); });
    if (team->rank() != 0) return follow(session);
    bool together = false;
    std::exception_ptr failure;
    Word end;
    end.end = true;
    try {
        body([&](const Words& words, const std::string& name) {
            if (!can_be_shared(words, *team)) return run_words(words, name, session);
            pass_on(*team, {false, words, name, ""});
            together = true;
            const Session::Kept kept = run_words(words, name, session, team);
            together = false;
            return kept;
        });
    } catch (const UsageError& e) {
        if (together) throw;
        end.usage_error = e.what();
        pass_on(*team, end);
        throw;
    } catch (const std::exception&) {
        if (together) throw;  // the others failed with it
        failure = std::current_exception();
    }
    pass_on(*team, end);
    run_together(*team, [&] {
        if (failure) std::rethrow_exception(failure);
    });
}

}  // namespace vdbgeo::app
