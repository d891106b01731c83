// Marching cubes against its peers and against the time that reading the samples once takes.
#include <fmt/format.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/global_control.h>

#include <cstdio>
#include <cstdlib>

#include "tests/bench/bench_input.h"
#include "tests/bench/harness.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/marching_cubes.h"
#ifdef VDBGEO_BENCH_VTK
#include "tests/bench/flying_edges.h"
#endif

using namespace vdbgeo;
using namespace vdbgeo::bench;

namespace {

constexpr const char* usage =
    "bench_marching_cubes MAP.mrc | --phantom KIND --size N [--snr SNR]\n"
    "  --iso V             isovalue (a phantom has one of its own)\n"
    "  --threads T         1\n"
    "  --repeat R          5 timed rounds\n"
    "  --only-active V     runs on the grid of the samples above V too\n"
    "  --peer NAME         only this one: vdbgeo, vdbgeo-active, openvdb, openvdb-active, flying-edges, "
    "read\n"
    "  --digest            prints a checksum of vdbgeo's mesh instead of timing\n";

struct Arguments {
    std::string map, phantom, peer;
    int size = 200, threads = 1, repeat = 5;
    std::optional<double> snr, isovalue;
    std::optional<float> only_active;
    bool digest = false;
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
        else if (word == "--threads")
            a.threads = std::stoi(value());
        else if (word == "--repeat")
            a.repeat = std::stoi(value());
        else if (word == "--only-active")
            a.only_active = std::stof(value());
        else if (word == "--peer")
            a.peer = value();
        else if (word == "--digest")
            a.digest = true;
        else if (word[0] != '-' && a.map.empty())
            a.map = word;
        else
            throw InvalidInput(fmt::format("unknown word '{}'\n{}", word, usage));
    }
    if (a.map.empty() == a.phantom.empty()) throw InvalidInput(usage);
    if (a.threads < 1 || a.repeat < 1) throw InvalidInput("--threads and --repeat begin at 1");
    return a;
}

Output run_vdbgeo(const DensityMap& map, double isovalue) {
    const auto mesh = std::make_shared<TriMesh>(marching_cubes(map, {isovalue}));
    return {mesh->triangles.size(), mesh->points.size(), mesh};
}

Output run_openvdb(const DensityMap& map, double isovalue) {
    struct Mesh {
        std::vector<openvdb::Vec3s> points;
        std::vector<openvdb::Vec3I> triangles;
        std::vector<openvdb::Vec4I> quads;
    };
    const auto mesh = std::make_shared<Mesh>();
    openvdb::tools::volumeToMesh(*map.grid, mesh->points, mesh->triangles, mesh->quads, isovalue, 0.0);
    return {mesh->triangles.size() + 2 * mesh->quads.size(), mesh->points.size(), mesh};
}

/// The floor: every sample is read once, by all threads, and compared with the isovalue.
Output run_read(const std::vector<float>& values, float isovalue) {
    constexpr std::size_t block = 1 << 16;
    const auto above = fixed_order_reduce(
        values.size(), block, std::uint64_t{0},
        [&](std::size_t begin, std::size_t end) {
            std::uint32_t n = 0;
            for (std::size_t i = begin; i < end; ++i) n += values[i] >= isovalue;
            return std::uint64_t{n};
        },
        [](std::uint64_t& sum, std::uint64_t part) { sum += part; });
    return {0, above, nullptr};
}

std::uint64_t fnv(const void* data, std::size_t bytes, std::uint64_t hash) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) hash = (hash ^ p[i]) * 0x100000001b3ull;
    return hash;
}

void print_digest(const DensityMap& map, double isovalue) {
    const TriMesh mesh = marching_cubes(map, {isovalue});
    const auto points = fnv(mesh.points.data(), mesh.points.size() * sizeof(Vec3f), 0xcbf29ce484222325ull);
    fmt::print("{:016x} {} vertices {} triangles\n",
               fnv(mesh.triangles.data(), mesh.triangles.size() * sizeof(Triangle), points),
               mesh.points.size(), mesh.triangles.size());
}

void run(const Arguments& args) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(args.threads));
    const Source source =
        args.map.empty() ? phantom_source(args.phantom, args.size, args.snr) : mrc_source(args.map);
    if (!args.isovalue && !source.isovalue) throw InvalidInput("a file needs --iso");
    const double isovalue = args.isovalue ? *args.isovalue : *source.isovalue;
    const auto wanted = [&](const char* name) { return args.peer.empty() || args.peer == name; };
    const bool active = args.only_active && (wanted("vdbgeo-active") || wanted("openvdb-active"));
    Inputs in = make_inputs(source, !args.digest && (wanted("flying-edges") || wanted("read")),
                            wanted("vdbgeo") || wanted("openvdb"), active ? args.only_active : std::nullopt);
    if (args.digest) {
        if (in.all) print_digest(*in.all, isovalue);
        if (in.active) print_digest(*in.active, isovalue);
        return;
    }

    std::vector<Contender> contenders;
    const auto add_grid = [&](const std::optional<DensityMap>& map, const std::string& suffix) {
        if (!map) return;
        const auto [leaves, crossed] = count_leaves(*map, static_cast<float>(isovalue));
        if (wanted(("vdbgeo" + suffix).c_str()))
            contenders.push_back({"vdbgeo" + suffix, [&map, isovalue] { return run_vdbgeo(*map, isovalue); },
                                  leaves, crossed});
        if (wanted(("openvdb" + suffix).c_str()))
            contenders.push_back({"openvdb" + suffix,
                                  [&map, isovalue] { return run_openvdb(*map, isovalue); }, leaves, crossed});
    };
    add_grid(in.all, "");
    add_grid(in.active, "-active");
#ifdef VDBGEO_BENCH_VTK
    if (wanted("flying-edges"))
        contenders.push_back({"flying-edges",
                              [&] { return flying_edges(in.dense, source.frame, isovalue, args.threads); },
                              {},
                              {}});
#endif
    if (wanted("read"))
        contenders.push_back(
            {"read", [&] { return run_read(in.dense, static_cast<float>(isovalue)); }, {}, {}});
    if (contenders.empty()) throw InvalidInput("no such peer here: " + args.peer);
    race(contenders, args.repeat);
    const Report report{"isosurface", source.name, isovalue, args.threads, contenders.size() == 1};
    for (const Contender& c : contenders) report.print(c);
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
