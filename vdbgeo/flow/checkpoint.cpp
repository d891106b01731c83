#include "vdbgeo/flow/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/file_hash.h"
#include "vdbgeo/core/run_together.h"
#include "vdbgeo/flow/state_file.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;

constexpr const char *list_name = "list", *first_line = "vdbgeo checkpoint 1";

std::string state_name(int rank) { return fmt::format("state_{:04}", rank); }

bool is_state(const fs::path& file) { return file.filename().string().rfind("state_", 0) == 0; }

/// Takes the list out first: without it the states are none.
void clear_generation(const fs::path& folder) {
    std::error_code error;
    fs::remove(folder / list_name, error);
    std::vector<fs::path> states;
    for (const auto& entry : fs::directory_iterator(folder, error))
        if (is_state(entry.path())) states.push_back(entry.path());
    for (const fs::path& file : states) fs::remove(file, error);
}

std::string hex(double value) { return fmt::format("{:a}", value); }

}  // namespace

/// What a generation's list says.
struct CheckpointedSolver::List {
    fs::path folder;
    int number = 0;
    std::string key;
    std::vector<Entry> log;
    std::vector<std::pair<std::string, std::string>> files;  // with their hashes

    std::string text() const {
        std::string out = fmt::format("{}\nnumber {}\nkey {}\n", first_line, number, key);
        for (const Entry& e : log)
            out += e.steps == 0 ? std::string("reset\n")
                                : fmt::format("cycle {} {} {}\n", e.steps, hex(e.tau), hex(e.removed));
        for (const auto& [name, hash] : files) out += fmt::format("file {} {}\n", name, hash);
        return out;
    }
    /// False where the text is not one that `text` made, with its hash behind.
    bool parse(const std::string& all) {
        const std::size_t end = all.rfind("end ");
        if (end == std::string::npos || all.substr(end) != "end " + text_hash(all.substr(0, end)) + "\n")
            return false;
        std::istringstream lines(all.substr(0, end));
        std::string line, word;
        if (!std::getline(lines, line) || line != first_line) return false;
        while (std::getline(lines, line)) {
            std::istringstream words(line);
            words >> word;
            std::string a, b, c;
            words >> a >> b >> c;
            if (word == "number") number = std::stoi(a);
            if (word == "key") key = a;
            if (word == "reset") log.push_back({});
            if (word == "cycle") log.push_back({std::stoi(a), std::stod(b), std::stod(c)});
            if (word == "file") files.emplace_back(a, b);
        }
        return !files.empty();
    }
};

CheckpointedSolver::CheckpointedSolver(CycleSolver& solver, const CheckpointOptions& options,
                                       const std::string& what, Team* team)
    : solver_(solver), options_(options), team_(team) {
    key_ = text_hash(
        fmt::format("{}\nmap {:016x}, {} voxels", what, solver.input_hash(), solver.active_voxels()));
    if (options_.resume) resume();
}

fs::path CheckpointedSolver::generation(int number) const {
    return options_.folder / (number % 2 == 0 ? "a" : "b");
}

bool CheckpointedSolver::anyone(bool mine) const {
    if (!team_) return mine;
    std::vector<std::uint64_t> count{mine};
    team_->add_up(count);
    return count[0] > 0;
}

/// The newest first.
std::vector<CheckpointedSolver::List> CheckpointedSolver::lists() const {
    std::vector<List> found;
    for (int g = 0; g < 2; ++g) {
        std::ifstream in(generation(g) / list_name, std::ios::binary);
        std::stringstream text;
        text << in.rdbuf();
        List list;
        list.folder = generation(g);
        if (in && list.parse(text.str())) found.push_back(list);
    }
    std::sort(found.begin(), found.end(), [](const List& a, const List& b) { return a.number > b.number; });
    return found;
}

/// Members look at some of the files each.
bool CheckpointedSolver::whole(const List& list) const {
    const std::size_t members = team_ ? static_cast<std::size_t>(team_->size()) : 1;
    bool bad = false;
    for (std::size_t i = team_ ? static_cast<std::size_t>(team_->rank()) : 0; i < list.files.size();
         i += members) {
        const fs::path file = list.folder / list.files[i].first;
        std::error_code error;
        bad = bad || !fs::is_regular_file(file, error) || file_hash(file) != list.files[i].second;
    }
    return !anyone(bad);
}

void CheckpointedSolver::resume() {
    for (const List& list : lists()) {
        if (list.key != key_)
            throw InvalidInput(options_.folder.string() +
                               ": the checkpoint is of another map or of other options");
        if (!whole(list)) continue;
        std::vector<fs::path> files;
        for (const auto& file : list.files) files.push_back(list.folder / file.first);
        solver_.load(StateReader(files, solver_.fields()));
        log_ = list.log;
        written_ = list.number;
        for (const Entry& e : log_) resumed_ += e.steps > 0;
        return;
    }
}

void CheckpointedSolver::cycle(Stepper stepper, int n, double tau, const Progress& progress) {
    if (next_ < log_.size()) {
        const Entry& done = log_[next_++];
        if (done.steps != n || done.tau != tau)
            throw InvalidInput(options_.folder.string() + ": the checkpoint is of other cycles");
        return;
    }
    solver_.cycle(stepper, n, tau, progress);
    log_.push_back({n, tau, -1});
    next_ = log_.size();
    const bool stop = anyone(options_.stop && options_.stop());
    if (++since_ >= options_.every || stop) write();
    if (stop) throw Cancelled();
}

void CheckpointedSolver::reset() {
    if (next_ < log_.size()) {
        ++next_;
        return;
    }
    solver_.reset();
    log_.push_back({});
    next_ = log_.size();
}

double CheckpointedSolver::removed() {
    if (next_ > 0 && log_[next_ - 1].removed >= 0) return log_[next_ - 1].removed;
    const double removed = solver_.removed();
    if (next_ > 0) log_[next_ - 1].removed = removed;
    return removed;
}

void CheckpointedSolver::write() {
    since_ = 0;
    List list;
    list.number = ++written_;
    list.folder = generation(list.number);
    list.key = key_;
    list.log = log_;
    const int rank = team_ ? team_->rank() : 0;
    const auto together = [&](const std::function<void()>& step) {
        team_ ? run_together(*team_, step) : step();
    };
    together([&] {
        if (rank != 0) return;
        std::error_code error;
        fs::create_directories(list.folder, error);
        if (error)
            throw IoError(fmt::format("{}: cannot be made: {}", list.folder.string(), error.message()));
        clear_generation(list.folder);
    });
    std::string hash;
    together([&] {
        StateWriter writer(list.folder / state_name(rank), solver_.fields());
        solver_.save(writer);
        hash = writer.finish();
    });
    std::vector<std::vector<char>> hashes{{hash.begin(), hash.end()}};
    if (team_) hashes = team_->gather(hashes[0]);
    for (std::size_t r = 0; r < hashes.size(); ++r)
        list.files.emplace_back(state_name(static_cast<int>(r)),
                                std::string(hashes[r].begin(), hashes[r].end()));
    together([&] {
        const std::string text = list.text();
        if (rank == 0) write_file(list.folder / list_name, text + "end " + text_hash(text) + "\n");
    });
}

int with_checkpoints(CycleSolver& solver, const CheckpointOptions& options, const std::string& what,
                     Team* team, const std::function<void(CycleSolver&)>& body) {
    if (options.folder.empty()) {
        body(solver);
        return 0;
    }
    CheckpointedSolver noted(solver, options, what, team);
    body(noted);
    return noted.resumed();
}

void remove_checkpoints(const fs::path& folder) {
    std::error_code error;
    for (const char* name : {"a", "b"}) {
        clear_generation(folder / name);
        if (fs::is_empty(folder / name, error)) fs::remove(folder / name, error);
    }
    if (fs::is_empty(folder, error)) fs::remove(folder, error);
}

}  // namespace vdbgeo
