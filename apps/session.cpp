#include "apps/session.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <mutex>

#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

volatile sig_atomic_t interrupted = 0, stop_wanted = 0;

void on_interrupt(int) {
    if (interrupted) _exit(130);  // a second Ctrl-C does not wait
    interrupted = 1;
}

void print_out(const std::string& text) {
    errno = 0;
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
        throw IoError(fmt::format("standard output: writing failed: {}", std::strerror(errno)));
}

}  // namespace

double Clock::seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

double Clock::lap() {
    const double passed = seconds();
    start_ = std::chrono::steady_clock::now();
    return passed;
}

/// Draws at most ten times a second, from whichever thread reports.
class Session::Bar {
 public:
    /// A passing bar is wiped away at its end.
    Bar(std::string name, bool quiet, bool passing)
        : name_(std::move(name)), quiet_(quiet), passing_(passing), terminal_(isatty(STDERR_FILENO) != 0) {}

    bool report(double fraction) {
        if (interrupted) return false;
        if (quiet_ || !terminal_) return true;
        const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
        if (!lock || clock_.seconds() - drawn_ < 0.1) return true;
        drawn_ = clock_.seconds();
        best_ = std::max(best_, fraction);
        const int width = 24, filled = static_cast<int>(best_ * width);
        const double left = best_ > 0.01 ? drawn_ * (1 - best_) / best_ : 0;
        fmt::print(stderr, "\r{:<10} [{}{}] {:3.0f} %  {:.0f} %/s  {:.0f} s left \033[K", name_,
                   std::string(filled, '#'), std::string(width - filled, '.'), 100 * best_,
                   100 * best_ / drawn_, left);
        std::fflush(stderr);
        return true;
    }

    void end() {
        if (passing_) return drop();
        if (quiet_ || ended_) return;
        ended_ = true;
        const std::lock_guard<std::mutex> lock(mutex_);
        fmt::print(stderr, "{}{:<10} {:.2f} s{}\n", terminal_ ? "\r" : "", name_, clock_.seconds(),
                   terminal_ ? "\033[K" : "");
    }

    void drop() {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (terminal_ && !quiet_ && !ended_) fmt::print(stderr, "\r\033[K");
        ended_ = true;
    }

 private:
    const std::string name_;
    const bool quiet_, passing_, terminal_;
    Clock clock_;
    double drawn_ = 0, best_ = 0;
    bool ended_ = false;
    std::mutex mutex_;
};

Progress Session::stage(const std::string& name) {
    if (rehearsal_) throw Rehearsed();
    end_stage();
    bar_ = std::make_shared<Bar>(kept_ ? step_ + ": " + name : name, quiet, kept_ != nullptr);
    return Progress([bar = bar_](double fraction) { return bar->report(fraction); });
}

void Session::end_stage() {
    if (bar_) bar_->end();
    bar_.reset();
}

void Session::drop_stage() {
    if (bar_) bar_->drop();
    bar_.reset();
}

void Session::say(const std::string& line) {
    end_stage();
    if (kept_) return;
    if (json || output_taken)
        fmt::print(stderr, "{}\n", line);
    else
        print_out(line + "\n");
}

void Session::warn(const std::string& line) {
    end_stage();
    if (kept_)
        kept_->warnings.push_back(line);
    else
        fmt::print(stderr, "{}: warning: {}\n", program, line);
}

void Session::result(const Json& value) {
    end_stage();
    if (kept_)
        kept_->result = value;
    else if (json)
        print_out(json_text(value, 2) + "\n");
}

Session Session::step(const std::string& name, std::shared_ptr<Kept> kept) const {
    Session session;
    session.program = program;
    session.quiet = quiet;
    session.threads = threads;
    session.step_ = name;
    session.kept_ = std::move(kept);
    return session;
}

Session Session::rehearsal() {
    Session session;
    session.kept_ = std::make_shared<Kept>();
    session.rehearsal_ = true;
    return session;
}

void Session::silence() {
    quiet = true;
    kept_ = std::make_shared<Kept>();
}

Session::~Session() { end_stage(); }

std::string json_text(const Json& value, int indent) {
    return value.dump(indent, ' ', false, Json::error_handler_t::replace);
}

std::function<bool()> stop_handler() {
    struct sigaction action {};
    action.sa_handler = [](int) { stop_wanted = 1; };
    sigaction(SIGTERM, &action, nullptr);
    sigaction(SIGUSR1, &action, nullptr);
    return [] { return stop_wanted != 0; };
}

void install_interrupt_handler() {
    struct sigaction action {};
    action.sa_handler = on_interrupt;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    // mpirun and srun pass it on at once; on SIGTERM they kill.
    sigaction(SIGUSR1, &action, nullptr);
    signal(SIGPIPE, SIG_IGN);  // a closed pipe is a write error, not a silent death
    signal(SIGXFSZ, SIG_IGN);  // so is a file that grew over its limit
}

}  // namespace vdbgeo::app
