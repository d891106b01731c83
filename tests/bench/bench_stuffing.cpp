// Isosurface stuffing: uniform and graded, of bodies of any size. One JSON object a line; "tets_per_second"
// by the median wall time, "bytes_per_tet" of the mesh itself, "peak_bytes_per_tet" by what the process grew
// to.
#include <fmt/format.h>
#include <sys/resource.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/bench/bench_input.h"
#include "tests/bench/harness.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/isosurface_stuffing.h"

using namespace vdbgeo;
using namespace vdbgeo::bench;

namespace {

constexpr const char* usage =
    "bench_stuffing MAP.mrc | --phantom KIND --size N [--snr SNR]\n"
    "  --iso V             isovalue (a phantom has one of its own)\n"
    "  --cell C            0.75 voxels\n"
    "  --coarsening K      only this one; else 0 and 3\n"
    "  --threads T         2\n"
    "  --repeat R          3 timed rounds\n";

struct Arguments {
    std::string map, phantom;
    int size = 128, threads = 2, repeat = 3, coarsening = -1;
    double cell = 0.75;
    std::optional<double> snr, isovalue;
};

Arguments parse(int count, char** words) {
    Arguments a;
    for (int i = 1; i < count; ++i) {
        const std::string word = words[i];
        const auto value = [&]() -> std::string {
            if (++i == count) throw InvalidInput(word + " needs a value");
            return words[i];
        };
        if (word == "--phantom")
            a.phantom = value();
        else if (word == "--size")
            a.size = std::stoi(value());
        else if (word == "--snr")
            a.snr = std::stod(value());
        else if (word == "--iso")
            a.isovalue = std::stod(value());
        else if (word == "--cell")
            a.cell = std::stod(value());
        else if (word == "--coarsening")
            a.coarsening = std::stoi(value());
        else if (word == "--threads")
            a.threads = std::stoi(value());
        else if (word == "--repeat")
            a.repeat = std::stoi(value());
        else if (word[0] != '-' && a.map.empty())
            a.map = word;
        else
            throw InvalidInput(fmt::format("unknown word '{}'\n{}", word, usage));
    }
    if (a.map.empty() == a.phantom.empty()) throw InvalidInput(usage);
    if (a.threads < 1 || a.repeat < 1) throw InvalidInput("--threads and --repeat begin at 1");
    return a;
}

double peak_rss() {
    rusage used{};
    getrusage(RUSAGE_SELF, &used);
    return 1024.0 * static_cast<double>(used.ru_maxrss);
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

void run(const Arguments& args) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(args.threads));
    const Source source =
        args.map.empty() ? phantom_source(args.phantom, args.size, args.snr) : mrc_source(args.map);
    if (!args.isovalue && !source.isovalue) throw InvalidInput("a file needs --iso");
    const double isovalue = args.isovalue ? *args.isovalue : *source.isovalue;
    const Inputs in = make_inputs(source, false, true, std::nullopt);
    for (const int coarsening : {0, 3}) {
        StuffingOptions options;
        options.cell = args.cell;
        options.coarsening = args.coarsening >= 0 ? args.coarsening : coarsening;
        double mesh_bytes = 0, faces = 0;
        const double before = peak_rss();
        std::vector<Contender> contenders;
        contenders.push_back({"vdbgeo",
                              [&] {
                                  const auto mesh = std::make_shared<TetMesh>(
                                      isosurface_stuffing(*in.all, isovalue, options));
                                  faces = static_cast<double>(mesh->faces.size());
                                  mesh_bytes = static_cast<double>(mesh->tets.size() * sizeof(Tetrahedron) +
                                                                   mesh->points.size() * sizeof(Vec3d)) +
                                               faces * (sizeof(Triangle) + sizeof(mesh->face_regions[0]));
                                  return Output{mesh->tets.size(), mesh->points.size(), mesh};
                              },
                              {},
                              {}});
        race(contenders, args.repeat);
        const Contender& c = contenders[0];
        const auto tets = static_cast<double>(c.last.triangles);
        fmt::print(
            R"({{"program": "vdbgeo", "task": "stuffing", "input": "{}", "iso": {}, "cell": {}, "coarsening": {}, )"
            R"("threads": {}, "runs": {}, "seconds_median": {:.6f}, "cpu_seconds_median": {:.6f}, "tets": {}, )"
            R"("vertices": {}, "boundary_faces": {}, "tets_per_second": {:.0f}, "tets_per_cpu_second": {:.0f}, )"
            R"("bytes_per_tet": {:.1f}, "peak_bytes_per_tet": {:.1f}}})"
            "\n",
            source.name, isovalue, options.cell, options.coarsening, args.threads, c.wall.size(),
            median(c.wall), median(c.cpu), c.last.triangles, c.last.vertices, faces, tets / median(c.wall),
            tets / median(c.cpu), mesh_bytes / tets, (peak_rss() - before) / tets);
        if (args.coarsening >= 0) break;
    }
}

}  // namespace

int main(int argc, char** argv) {
    try {
        openvdb::initialize();
        run(parse(argc, argv));
        return EXIT_SUCCESS;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
        return EXIT_FAILURE;
    }
}
