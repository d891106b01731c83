#include "apps/tet_compare.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "converters/tet_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/cutaway.h"
#include "vdbgeo/view/image.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/view/render.h"
#include "vdbgeo/view/text.h"

namespace vdbgeo::app {
namespace {

/// This program under other words; what it prints is collected.
class Child {
 public:
    explicit Child(const std::vector<std::string>& words) {
        std::array<int, 2> out{}, err{};
        if (pipe2(out.data(), O_CLOEXEC) != 0 || pipe2(err.data(), O_CLOEXEC) != 0)
            throw IoError(fmt::format("no pipe: {}", std::strerror(errno)));
        std::vector<char*> arguments;
        for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
        arguments.push_back(nullptr);
        pid_ = fork();
        if (pid_ < 0) throw IoError(fmt::format("no other process: {}", std::strerror(errno)));
        if (pid_ == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            dup2(out[1], STDOUT_FILENO);
            dup2(err[1], STDERR_FILENO);
            execv("/proc/self/exe", arguments.data());
            _exit(127);
        }
        close(out[1]);
        close(err[1]);
        pipes_ = {out[0], err[0]};
    }
    ~Child() {
        if (pid_ > 0) {
            kill(pid_, SIGKILL);
            while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
            }
        }
        for (const int pipe : pipes_) close(pipe);
    }
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;

    /// Waits for its end, asking `progress` ten times a second; returns the status of waitpid.
    int finish(const Progress& progress) {
        std::array<pollfd, 2> wait{{{pipes_[0], POLLIN, 0}, {pipes_[1], POLLIN, 0}}};
        for (int open = 2; open > 0;) {
            progress.report(0);
            if (poll(wait.data(), wait.size(), 100) <= 0) continue;
            for (std::size_t i = 0; i < wait.size(); ++i) {
                if (wait[i].fd < 0 || wait[i].revents == 0) continue;
                std::array<char, 65536> buffer;
                const ssize_t got = read(wait[i].fd, buffer.data(), buffer.size());
                if (got > 0) {
                    text[i].append(buffer.data(), static_cast<std::size_t>(got));
                } else if (got == 0 || errno != EINTR) {
                    wait[i].fd = -1;
                    --open;
                }
            }
        }
        int status = 0;
        while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
        }
        pid_ = -1;
        return status;
    }

    std::array<std::string, 2> text;  ///< standard output, standard error

 private:
    pid_t pid_ = -1;
    std::array<int, 2> pipes_{};
};

/// The last line that begins as an error does, without that beginning.
std::string error_line(const std::string& text) {
    const std::string begin = "vdbgeo: error: ";
    const std::size_t at = text.rfind(begin);
    if (at == std::string::npos) return "";
    const std::size_t from = at + begin.size();
    return text.substr(from, text.find('\n', from) - from);
}

struct Column {
    const char* name;  ///< of the CSV
    const char* title;
    std::string (*value)(const MethodRun&);
};

std::string number(const Json& j, const char* key, const char* format, double factor = 1) {
    if (!j.contains(key) || !j[key].is_number()) return "";
    return fmt::format(fmt::runtime(format), factor * j[key].get<double>());
}

double seconds_of(const Json& j) {
    double sum = 0;
    for (const char* stage : {"surface", "compute", "optimize"}) sum += j["seconds"].value(stage, 0.0);
    return sum;
}

const std::vector<Column>& columns() {
    static const std::vector<Column> table{
        {"method", "method", [](const MethodRun& r) { return r.method; }},
        {"seconds", "s", [](const MethodRun& r) { return fmt::format("{:.3g}", seconds_of(r.result)); }},
        {"seconds_in_all", "s in all",
         [](const MethodRun& r) { return fmt::format("{:.3g}", r.wall_seconds); }},
        {"peak_MB", "MB", [](const MethodRun& r) { return number(r.result, "peak_bytes", "{:.0f}", 1e-6); }},
        {"vertices", "vertices", [](const MethodRun& r) { return number(r.result, "vertices", "{:.0f}"); }},
        {"tets", "tets", [](const MethodRun& r) { return number(r.result, "tets", "{:.0f}"); }},
        {"min_dihedral_deg", "min °",
         [](const MethodRun& r) { return number(r.result, "min_dihedral_deg", "{:.4g}"); }},
        {"min_dihedral_p01_deg", "1 % below °",
         [](const MethodRun& r) { return number(r.result, "min_dihedral_p01_deg", "{:.4g}"); }},
        {"max_dihedral_deg", "max °",
         [](const MethodRun& r) { return number(r.result, "max_dihedral_deg", "{:.4g}"); }},
        {"radius_edge_max", "radius-edge",
         [](const MethodRun& r) { return number(r.result, "radius_edge_max", "{:.4g}"); }},
        {"slivers", "slivers", [](const MethodRun& r) { return number(r.result, "slivers", "{:.0f}"); }},
        {"inverted", "inverted", [](const MethodRun& r) { return number(r.result, "inverted", "{:.0f}"); }},
        {"volume_A3", "Å³", [](const MethodRun& r) { return number(r.result, "volume_A3", "{:.6g}"); }},
        {"volume_error_percent", "volume %",
         [](const MethodRun& r) { return number(r.result, "volume_error", "{:+.3g}", 100); }},
        {"hausdorff_A", "distance Å",
         [](const MethodRun& r) { return number(r.result, "hausdorff_A", "{:.3g}"); }}};
    return table;
}

/// One mesh cut through the middle of its box, seen from the front.
Image draw_cut_open(const MethodRun& run, int side) {
    const TetMesh mesh = read_tets(run.file);
    Vec3d low = mesh.points[0], high = low;
    for (const Vec3d& p : mesh.points) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    CutawayOptions cut;
    cut.plane.emplace();
    cut.plane->point = (low + high) / 2;
    cut.plane->normal = -Vec3d::UnitY();  // the half before the viewer goes
    TriMesh open = cutaway(mesh, cut);
    open.vertex_properties.clear();  // each face in the one colour of its tetrahedron
    RenderOptions o;
    o.width = o.height.emplace(side);
    o.view = "front";
    o.edges = true;
    o.property = "min_dihedral_deg";
    o.label = "smallest dihedral angle (°)";
    o.range_min = 0;
    o.range_max = 70.5;
    const Json& j = run.result;
    o.title =
        fmt::format("{}: {} tets, {:.1f}° to {:.1f}°, {:.2g} s", run.method, j["tets"].get<std::uint64_t>(),
                    j["min_dihedral_deg"].get<double>(), j["max_dihedral_deg"].get<double>(), seconds_of(j));
    return render(open, o);
}

}  // namespace

MethodRun run_method(const std::string& in, const std::string& method, const std::string& file,
                     const std::vector<std::string>& words, const Session& session,
                     const Progress& progress) {
    std::vector<std::string> command{"vdbgeo",   "tetrahedralize", in,       file,
                                     "--method", method,           "--json", "--quiet"};
    if (session.threads > 0) command.insert(command.end(), {"--threads", fmt::format("{}", session.threads)});
    command.insert(command.end(), words.begin(), words.end());
    MethodRun run{method, file, "", 0, {}};
    const Clock clock;
    Child child(command);
    const int status = child.finish(progress);
    run.wall_seconds = clock.seconds();
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        run.result = Json::parse(child.text[0]);
        return run;
    }
    run.error = error_line(child.text[1]);
    if (run.error.empty())
        run.error = WIFSIGNALED(status) ? fmt::format("ended by signal {}", WTERMSIG(status))
                                        : fmt::format("exit code {}", WEXITSTATUS(status));
    return run;
}

std::string comparison_csv(const std::vector<MethodRun>& runs) {
    std::string csv;
    for (const Column& c : columns()) csv += fmt::format("{},", c.name);
    csv += "error\n";
    for (const MethodRun& run : runs) {
        for (const Column& c : columns())
            csv += (run.error.empty() || &c == &columns()[0] ? c.value(run) : "") + ",";
        std::string error = run.error;
        for (char& c : error)
            if (c == '"') c = '\'';
        csv += error.empty() ? "\n" : fmt::format("\"{}\"\n", error);
    }
    return csv;
}

std::vector<std::string> comparison_text(const std::vector<MethodRun>& runs) {
    std::vector<std::vector<std::string>> rows(1);
    for (const Column& c : columns()) rows[0].push_back(c.title);
    for (const MethodRun& run : runs) {
        if (!run.error.empty()) continue;
        rows.emplace_back();
        for (const Column& c : columns()) rows.back().push_back(c.value(run));
    }
    std::vector<std::string> lines;
    const auto width = [](const std::string& s) {  // of UTF-8
        return static_cast<std::size_t>(
            std::count_if(s.begin(), s.end(), [](char c) { return (c & 0xC0) != 0x80; }));
    };
    for (const auto& row : rows) {
        std::string line;
        for (std::size_t c = 0; c < row.size(); ++c) {
            std::size_t widest = 0;
            for (const auto& r : rows) widest = std::max(widest, width(r[c]));
            const std::string blanks(widest - width(row[c]), ' ');
            line += c == 0 ? row[c] + blanks : "  " + blanks + row[c];
        }
        lines.push_back(line);
    }
    for (const MethodRun& run : runs)
        if (!run.error.empty()) lines.push_back(fmt::format("{:<9} failed: {}", run.method, run.error));
    return lines;
}

void draw_comparison(const std::vector<MethodRun>& runs, const std::string& title, const std::string& path,
                     const Progress& progress) {
    constexpr int side = 900, head = 70;
    const Vec3f ink(0.15f, 0.15f, 0.18f);
    Image sheet(side * static_cast<int>(runs.size()), side + head);
    draw_text(sheet, {sheet.width / 2.0, 0.65 * head}, title, 36, ink, TextAlign::centre);
    for (std::size_t i = 0; i < runs.size(); ++i) {
        const MethodRun& run = runs[i];
        const int left = side * static_cast<int>(i);
        progress.report(static_cast<double>(i) / static_cast<double>(runs.size()));
        if (run.error.empty()) {
            paste(sheet, draw_cut_open(run, side), left, head);
        } else {
            draw_text(sheet, {left + side / 2.0, head + side / 2.0}, run.method + ": failed", 36, ink,
                      TextAlign::centre);
        }
    }
    write_png(sheet, path);
}

}  // namespace vdbgeo::app
