// Runs a program as a user does: arguments, output, exit code, time and memory; limits and signals on demand.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace vdbgeo::test {

/// Sanitizers reserve memory of their own and slow everything down: limits mean nothing under them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

struct RunOptions {
    std::filesystem::path input = "/dev/null";                        ///< standard input
    std::filesystem::path output;                                     ///< standard output goes here if set
    std::filesystem::path folder;                                     ///< working folder, if set
    std::vector<std::pair<__rlimit_resource, std::uint64_t>> limits;  ///< RLIMIT_… and its value
    std::optional<uid_t> user;                                        ///< run as this user
    int signal = SIGKILL;                                   ///< what is sent, where one of these is set:
    std::optional<std::chrono::milliseconds> signal_after;  ///< after the start, or
    std::optional<std::string> signal_at;  ///< once standard error has this text (empty: anything)
    std::filesystem::path signal_by_file;  ///< once this file is there
    bool signal_heard = false;             ///< not before the program has a handler for it
    std::chrono::seconds give_up{240};     ///< then it is killed
};

struct Ended {
    std::optional<int> code;    ///< exit code
    std::optional<int> killed;  ///< the signal that ended it instead
    std::string out, err;
    double seconds = 0;
    std::uint64_t peak_bytes = 0;  ///< largest resident memory; the caller's own counts if that is larger
    bool signalled = false;        ///< the signal was sent before the end
    double seconds_signalled = 0;  ///< when, after the start
};

namespace run_detail {

[[noreturn]] inline void child(const std::vector<std::string>& command, const RunOptions& options, int out,
                               int err) {
    const int in = ::open(options.input.c_str(), O_RDONLY);
    if (!options.output.empty()) out = ::open(options.output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (in < 0 || out < 0) ::_exit(126);
    ::dup2(in, 0), ::dup2(out, 1), ::dup2(err, 2);
    if (!options.folder.empty() && ::chdir(options.folder.c_str()) != 0) ::_exit(126);
    for (const auto& [resource, value] : options.limits) {
        const struct rlimit limit { value, value };
        if (::setrlimit(resource, &limit) != 0) ::_exit(126);
    }
    if (options.user && (::setgid(*options.user) != 0 || ::setuid(*options.user) != 0)) ::_exit(126);
    std::vector<char*> arguments;
    for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
    arguments.push_back(nullptr);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
}

/// Whether a process has a handler for a signal: it has none while its libraries are being loaded.
inline bool handles(pid_t pid, int signal) {
    std::ifstream status("/proc/" + std::to_string(pid) + "/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind("SigCgt:", 0) == 0)
            return std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1;
    return false;
}

}  // namespace run_detail

/// Runs `command` (the program's path and its arguments) and waits for its end. Exit code 127: there is no
/// such program, or the user may not run it; 126: the surroundings could not be made.
inline Ended run(const std::vector<std::string>& command, const RunOptions& options = {}) {
    using clock = std::chrono::steady_clock;
    std::array<std::array<int, 2>, 2> pipes;
    for (auto& pipe : pipes)
        if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    const auto start = clock::now();
    const pid_t pid = ::fork();
    if (pid < 0) throw std::runtime_error("no fork");
    if (pid == 0) run_detail::child(command, options, pipes[0][1], pipes[1][1]);
    ::close(pipes[0][1]), ::close(pipes[1][1]);

    Ended result;
    std::array<std::string*, 2> texts{&result.out, &result.err};
    std::array<pollfd, 2> watched{pollfd{pipes[0][0], POLLIN, 0}, pollfd{pipes[1][0], POLLIN, 0}};
    const auto send = [&](int signal) {
        if (options.signal_heard && !run_detail::handles(pid, signal)) return;
        if (std::exchange(result.signalled, true)) return;
        result.seconds_signalled = std::chrono::duration<double>(clock::now() - start).count();
        ::kill(pid, signal);
    };
    while (watched[0].fd >= 0 || watched[1].fd >= 0) {
        ::poll(watched.data(), watched.size(), 5);
        for (std::size_t i = 0; i < 2; ++i) {
            if (watched[i].fd < 0 || watched[i].revents == 0) continue;
            std::array<char, 65536> buffer;
            const ssize_t n = ::read(watched[i].fd, buffer.data(), buffer.size());
            if (n > 0) texts[i]->append(buffer.data(), static_cast<std::size_t>(n));
            if (n == 0) ::close(std::exchange(watched[i].fd, -1));
        }
        const auto passed = clock::now() - start;
        if (options.signal_after && passed >= *options.signal_after) send(options.signal);
        if (options.signal_at && !result.err.empty() &&
            result.err.find(*options.signal_at) != std::string::npos)
            send(options.signal);
        if (!options.signal_by_file.empty() && std::filesystem::exists(options.signal_by_file))
            send(options.signal);
        if (passed > options.give_up) ::kill(pid, SIGKILL);
    }
    int status = 0;
    struct rusage usage {};
    while (::wait4(pid, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    result.seconds = std::chrono::duration<double>(clock::now() - start).count();
    result.peak_bytes = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
    if (WIFEXITED(status)) result.code = WEXITSTATUS(status);
    if (WIFSIGNALED(status)) result.killed = WTERMSIG(status);
    return result;
}

}  // namespace vdbgeo::test
