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

    /// Words as they are, each with its length before it: names of files can hold any bytes.
    std::vector<char> bytes() const {
        std::string text(1, end ? '1' : '0');
        const auto add = [&](const std::string& word) { text += std::to_string(word.size()) + ':' + word; };
        add(name);
        add(usage_error);
        for (const std::string& word : line) add(word);
        return {text.begin(), text.end()};
    }
    static Word parse(const std::vector<char>& bytes) {
        const std::string text(bytes.begin(), bytes.end());
        Words words;
        for (std::size_t at = 1; at < text.size();) {
            const std::size_t begin = text.find(':', at) + 1, length = std::stoul(text.substr(at));
            words.push_back(text.substr(begin, length));
            at = begin + length;
        }
        return {text[0] == '1', Words(words.begin() + 2, words.end()), words[0], words[1]};
    }
};

/// The first says it, and all know.
Word pass_on(Team& team, const Word& word) {
    team.rest_until_all_come();
    const auto all = team.gather(team.rank() == 0 ? word.bytes() : std::vector<char>());
    return Word::parse(all[0]);
}

/// By the command's own word, on its command line and its input's header. What it finds wrong may be wrong
/// for a team only, such as more members than a small map has units: then the first runs it alone.
bool can_be_shared(const Words& words, Team& team) {
    if (words[0] != "denoise" && words[0] != "surface") return false;
    try {
        rehearse(words, &team);
        return true;
    } catch (const std::exception&) {
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
