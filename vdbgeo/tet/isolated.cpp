#include "vdbgeo/tet/isolated.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using Clock = std::chrono::steady_clock;

/// Sanitizers reserve address space by the terabyte.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool can_limit_memory = false;
#else
constexpr bool can_limit_memory = true;
#endif

enum class Outcome : std::uint64_t { bytes, invalid_input, numerical_error, out_of_memory };

/// What the child sends: this, then the bytes of the result or of the message.
struct Head {
    Outcome outcome;
    std::uint64_t size;
};

// ---- the child ----

bool send_all(int out, const void* data, std::size_t size) {
    const char* at = static_cast<const char*>(data);
    while (size > 0) {
        const ssize_t sent = write(out, at, size);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return false;
        at += sent;
        size -= static_cast<std::size_t>(sent);
    }
    return true;
}

[[noreturn]] void leave(int out, Outcome outcome, const void* data, std::size_t size) {
    const Head head{outcome, size};
    const bool sent = send_all(out, &head, sizeof head) && send_all(out, data, size);
    _exit(sent ? 0 : 1);  // no destructors, no handlers of the parent's
}

[[noreturn]] void leave(int out, Outcome outcome, const char* message) {
    leave(out, outcome, message, std::strlen(message));
}

/// Signals as in a program that has just started; but those that a terminal sends to all of a group are the
/// parent's to answer.
void reset_signals() {
    struct sigaction action {};
    for (int s = 1; s < NSIG; ++s) {
        const bool from_terminal = s == SIGINT || s == SIGQUIT || s == SIGHUP || s == SIGTERM;
        action.sa_handler = from_terminal ? SIG_IGN : SIG_DFL;
        sigaction(s, &action, nullptr);
    }
    sigset_t none;
    sigemptyset(&none);
    pthread_sigmask(SIG_SETMASK, &none, nullptr);
}

/// Nothing but the pipe stays open: another child's pipe, or a file's lock, must not live on in this one.
int keep_only(int out) {
    const int null = open("/dev/null", O_RDWR);
    for (int fd = 0; fd < 3; ++fd) dup2(null, fd);
    if (out != 3) dup2(out, 3);
    syscall(SYS_close_range, 4u, ~0u, 0u);
    return 3;
}

void set_limits(std::uint64_t address_space) {
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    if (address_space == 0) return;
    rlimit memory{};
    getrlimit(RLIMIT_AS, &memory);
    memory.rlim_cur = std::min<rlim_t>(memory.rlim_cur, address_space);
    setrlimit(RLIMIT_AS, &memory);
}

[[noreturn]] void run_child(const std::function<std::vector<std::byte>()>& work, int out,
                            std::uint64_t address_space, pid_t parent) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(1);  // it died before the line above
    out = keep_only(out);
    set_limits(address_space);
    reset_signals();
    try {
        const std::vector<std::byte> result = work();
        leave(out, Outcome::bytes, result.data(), result.size());
    } catch (const InvalidInput& e) {
        leave(out, Outcome::invalid_input, e.what());
    } catch (const std::bad_alloc&) {
        leave(out, Outcome::out_of_memory, "");
    } catch (const std::exception& e) {
        leave(out, Outcome::numerical_error, e.what());
    } catch (...) {
        leave(out, Outcome::numerical_error, "failed without saying why");
    }
}

// ---- the parent ----

std::uint64_t present_address_space() {
    std::ifstream statm("/proc/self/statm");
    std::uint64_t pages = 0;
    statm >> pages;
    return pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

/// A running child; killed and waited for at the latest when this goes.
class Child {
 public:
    Child(const std::function<std::vector<std::byte>()>& work, const IsolationLimits& limits,
          const std::string& what) {
        std::uint64_t space = 0;
        if (can_limit_memory && limits.max_bytes > 0) space = present_address_space() + limits.max_bytes;
        int ends[2];
        if (pipe2(ends, O_CLOEXEC) != 0)
            throw NumericalError(fmt::format("{}: no pipe: {}", what, std::strerror(errno)));
        fcntl(ends[1], F_SETPIPE_SZ, 1 << 20);
        // No handler of ours may run in the child.
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before);
        const pid_t parent = getpid();
        pid_ = fork();
        if (pid_ == 0) run_child(work, ends[1], space, parent);
        const int error = errno;
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
        close(ends[1]);
        in_ = ends[0];
        if (pid_ > 0) return;
        close(in_);
        throw NumericalError(fmt::format("{}: no process of its own: {}", what, std::strerror(error)));
    }
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;
    ~Child() {
        kill_and_wait();
        close(in_);
    }

    int in() const { return in_; }

    /// Whether it has ended.
    bool ended() {
        if (!ended_) wait(WNOHANG);
        return ended_;
    }
    /// The status of waitpid; −1 where nobody knows (the process ignores SIGCHLD).
    int wait_for_end() {
        if (!ended_) wait(0);
        return status_;
    }
    void kill_and_wait() {
        if (ended()) return;
        kill(pid_, SIGKILL);
        wait_for_end();
    }

 private:
    void wait(int flags) {
        int status = 0;
        pid_t pid;
        do pid = waitpid(pid_, &status, flags);
        while (pid < 0 && errno == EINTR);
        ended_ = pid != 0;
        if (ended_) status_ = pid < 0 ? -1 : status;
    }

    pid_t pid_ = -1;
    int in_ = -1;
    bool ended_ = false;
    int status_ = -1;
};

/// What has come of a message so far.
class Message {
 public:
    /// Reads what there is; false at the end of the pipe.
    bool read_some(int in) {
        if (head_size_ < sizeof head_) {
            const ssize_t got =
                read(in, reinterpret_cast<char*>(&head_) + head_size_, sizeof head_ - head_size_);
            if (got <= 0) return got < 0 && errno == EINTR;
            head_size_ += static_cast<std::size_t>(got);
            if (head_size_ == sizeof head_) make_room();
            return true;
        }
        const ssize_t got = read(in, bytes_.data() + size_, bytes_.size() - size_);
        if (got <= 0) return got < 0 && errno == EINTR;
        size_ += static_cast<std::size_t>(got);
        return true;
    }
    bool whole() const { return head_size_ == sizeof head_ && size_ == bytes_.size(); }
    Outcome outcome() const { return head_.outcome; }
    std::vector<std::byte>& bytes() { return bytes_; }
    std::string text() const { return {reinterpret_cast<const char*>(bytes_.data()), bytes_.size()}; }

 private:
    /// The size may be anything, where the library wrote over memory that is not its own.
    void make_room() {
        try {
            bytes_.resize(head_.size);
        } catch (const std::exception&) {
            throw NumericalError(fmt::format("no memory for a result of {} bytes", head_.size));
        }
    }

    Head head_{};
    std::size_t head_size_ = 0, size_ = 0;
    std::vector<std::byte> bytes_;
};

const char* name_of_signal(int s) {
    const char* name = sigabbrev_np(s);
    return name ? name : "?";
}

[[noreturn]] void throw_death(int status, const std::string& what) {
    if (status != -1 && WIFSIGNALED(status)) {
        const int s = WTERMSIG(status);
        if (s == SIGKILL)
            throw NumericalError(what + ": killed (SIGKILL); the machine may have run out of memory");
        throw NumericalError(fmt::format("{}: crashed (SIG{})", what, name_of_signal(s)));
    }
    throw NumericalError(fmt::format("{}: ended without a result (exit code {})", what,
                                     status != -1 && WIFEXITED(status) ? WEXITSTATUS(status) : -1));
}

std::vector<std::byte> take(Message& message, const IsolationLimits& limits, const std::string& what) {
    switch (message.outcome()) {
        case Outcome::bytes:
            return std::move(message.bytes());
        case Outcome::invalid_input:
            throw InvalidInput(fmt::format("{}: {}", what, message.text()));
        case Outcome::out_of_memory:
            if (limits.max_bytes == 0) throw NumericalError(what + ": out of memory");
            throw NumericalError(fmt::format("{}: out of memory: it may take {:.4g} MB", what,
                                             double(limits.max_bytes) / 1e6));
        default:
            throw NumericalError(fmt::format("{}: {}", what, message.text()));
    }
}

}  // namespace

std::vector<std::byte> run_isolated(const std::function<std::vector<std::byte>()>& work,
                                    const IsolationLimits& limits, const std::string& what,
                                    const Progress& progress) {
    progress.report(0);
    const auto tick = std::chrono::milliseconds(100);
    const auto start = Clock::now();
    const std::chrono::duration<double> most(limits.max_seconds);
    Child child(work, limits, what);
    Message message;
    auto next_report = start + tick;
    for (bool open = true; open && !message.whole();) {
        pollfd wait{child.in(), POLLIN, 0};
        const int ready = poll(&wait, 1, static_cast<int>(tick.count()));
        if (ready > 0) open = message.read_some(child.in());
        const auto now = Clock::now();
        if (now < next_report) continue;
        next_report = now + tick;
        progress.report(0);
        if (now - start > most)
            throw NumericalError(
                fmt::format("{}: stopped after {:.6g} s, its limit", what, limits.max_seconds));
    }
    if (!message.whole()) throw_death(child.wait_for_end(), what);
    child.wait_for_end();
    progress.report(1);
    return take(message, limits, what);
}

}  // namespace vdbgeo
