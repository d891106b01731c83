// What a run of a command shares: options for all commands, progress on the terminal, and what it prints.
#pragma once

#include <nlohmann/json.hpp>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/team.h"

namespace vdbgeo::app {

using Json = nlohmann::ordered_json;

/// A command line that makes no sense: exit code 2.
class UsageError : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Seconds since it was made, or since the last `lap`.
class Clock {
 public:
    double seconds() const;
    double lap();

 private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

class Session {
 public:
    std::string program = "vdbgeo";  ///< begins every warning and error
    bool json = false;               ///< one JSON object on standard output, all else on standard error
    bool quiet = false;              ///< no progress
    int threads = 0;                 ///< 0: as many as there are
    Team* team = nullptr;            ///< of a run on several machines: each member has a part of the map
    bool output_taken = false;  ///< a file goes to standard output: lines for people go to standard error

    /// Progress of one stage: a bar with rate and time left on a terminal, else one line when it ends.
    Progress stage(const std::string& name);
    /// Ends the running stage's line; called by everything that prints.
    void end_stage();
    /// Forgets the running stage, which failed: only the error is told.
    void drop_stage();
    /// One line for people: standard output, or standard error where that is taken.
    void say(const std::string& line);
    /// One line on standard error.
    void warn(const std::string& line);
    /// The result. Printed as JSON with --json. Throws IoError where standard output is full, as `say` does.
    void result(const Json& json);

    /// A session for a command that runs as a step of this one: it prints nothing but its progress, which is
    /// wiped away at its end; what it warns of and its result are kept in `kept`.
    struct Kept {
        Json result;
        std::vector<std::string> warnings;
    };
    Session step(const std::string& name, std::shared_ptr<Kept> kept) const;

    /// A session for a command that shall only look at its own command line, which all commands do before
    /// their first stage: `stage` throws Rehearsed.
    struct Rehearsed {};
    static Session rehearsal();

    /// Nothing is printed any more: for the members of a team that have not the word.
    void silence();

    ~Session();

 private:
    class Bar;
    std::shared_ptr<Bar> bar_;
    std::string step_;            ///< name of the step, empty for a session of its own
    std::shared_ptr<Kept> kept_;  ///< of a step
    bool rehearsal_ = false;
};

/// JSON as text; what is not UTF-8 in it (names of files can be anything) becomes U+FFFD.
std::string json_text(const Json& value, int indent = -1);

/// Ctrl-C sets a flag that every progress report looks at.
void install_interrupt_handler();

/// From now on SIGTERM and SIGUSR1 do not interrupt: they are asked for by what comes back.
std::function<bool()> stop_handler();

}  // namespace vdbgeo::app
