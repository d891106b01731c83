// Curvature by all of vdbgeo's methods and by its peers, in one process and in turns.
#include <fmt/format.h>
#include <openvdb/openvdb.h>
#include <sys/resource.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "converters/map_file.h"
#include "converters/mesh_file.h"
#include "tests/bench/curvature_peers.h"
#include "tests/bench/curved_mesh.h"
#include "tests/bench/harness.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/adaptive_curvature.h"
#include "vdbgeo/measure/curvature_tensor.h"
#include "vdbgeo/measure/discrete_curvature.h"
#include "vdbgeo/measure/field_curvature.h"
#include "vdbgeo/measure/jet_curvature.h"
#include "vdbgeo/measure/normal_voting.h"

using namespace vdbgeo;
using namespace vdbgeo::bench;

namespace {

constexpr const char* usage =
    "bench_curvature MESH | --faces N  [--shape sphere:R|torus:RING,TUBE[@X,Y,Z]]\n"
    "  --shape S           what the mesh lies on: errors are told; with --faces the mesh is made on it\n"
    "                      (sphere:100)\n"
    "  --map MAP           the map the mesh was cut from, for the field's own curvature\n"
    "  --degree D          2, of jets\n"
    "  --rings K           2, of jets\n"
    "  --radius R          of the ball and of the votes, Å; none: their defaults\n"
    "  --threads T         1; peers have one\n"
    "  --repeat R          3 timed rounds\n"
    "  --only NAMES        comma-separated: discrete,ring,ball,geodesic,jets,adaptive,voting,field,vtk,cgal\n"
    "                      (all but geodesic and voting); alone, the peak memory is told\n";

struct Arguments {
    std::string mesh, shape, map, only = "discrete,ring,ball,jets,adaptive,field,vtk,cgal";
    std::optional<double> faces, radius;
    int degree = 2, rings = 2, threads = 1, repeat = 3;
};

Arguments parse(int count, char** words) {
    Arguments a;
    for (int i = 1; i < count; ++i) {
        const std::string word = words[i];
        const auto value = [&]() -> std::string {
            if (++i == count) throw InvalidInput(word + " needs a value");
            return words[i];
        };
        if (word == "--faces")
            a.faces = std::stod(value());
        else if (word == "--shape")
            a.shape = value();
        else if (word == "--map")
            a.map = value();
        else if (word == "--degree")
            a.degree = std::stoi(value());
        else if (word == "--rings")
            a.rings = std::stoi(value());
        else if (word == "--radius")
            a.radius = std::stod(value());
        else if (word == "--threads")
            a.threads = std::stoi(value());
        else if (word == "--repeat")
            a.repeat = std::stoi(value());
        else if (word == "--only")
            a.only = value();
        else if (word[0] != '-' && a.mesh.empty())
            a.mesh = word;
        else
            throw InvalidInput(fmt::format("unknown word '{}'\n{}", word, usage));
    }
    if (a.mesh.empty() == !a.faces) throw InvalidInput(usage);
    if (a.threads < 1 || a.repeat < 1) throw InvalidInput("--threads and --repeat begin at 1");
    if (a.faces && a.shape.empty()) a.shape = "sphere:100";
    return a;
}

double peak_bytes() {
    rusage used{};
    getrusage(RUSAGE_SELF, &used);
    return static_cast<double>(used.ru_maxrss) * 1024;
}

/// A contender whose last result is kept for its errors.
struct Method {
    std::string name;
    std::function<Curvatures()> run;
    Curvatures result{};
};

Curvatures of_peer(PeerCurvature&& peer) {
    Curvatures out;
    out.H = std::move(peer.mean);
    out.K = std::move(peer.gauss);
    return out;
}

std::vector<Method> methods_of(const Arguments& args, const TriMesh& mesh,
                               const std::optional<DensityMap>& map) {
    std::vector<Method> out;
    const std::string list = "," + args.only + ",";
    const auto add = [&](const char* name, std::function<Curvatures()> run) {
        if (list.find(fmt::format(",{},", name)) != std::string::npos) out.push_back({name, std::move(run)});
    };
    const auto tensor = [&](TensorNeighbourhood kind) {
        return [&mesh, kind, radius = args.radius] {
            return tensor_curvature(
                mesh, {kind, kind == TensorNeighbourhood::ring ? std::optional<double>() : radius});
        };
    };
    add("discrete", [&] { return discrete_curvature(mesh); });
    add("ring", tensor(TensorNeighbourhood::ring));
    add("ball", tensor(TensorNeighbourhood::ball));
    add("geodesic", tensor(TensorNeighbourhood::geodesic));
    add("jets", [&] {
        JetOptions options;
        options.degree = args.degree;
        options.rings = args.rings;
        return jet_curvature(mesh, options);
    });
    add("adaptive", [&] { return adaptive_curvature(mesh); });
    add("voting", [&] { return voted_curvature(mesh, {args.radius}); });
    if (map) add("field", [&] { return field_curvature(mesh, *map); });
#ifdef VDBGEO_BENCH_VTK
    if (list.find(",vtk,") != std::string::npos)
        add("vtk", [run = vtk_curvatures(mesh)] { return of_peer(run()); });
#endif
#ifdef VDBGEO_BENCH_CGAL
    add("cgal", [&] { return of_peer(cgal_jets(mesh, args.degree, args.rings)); });
#endif
    if (out.empty()) throw InvalidInput("no such method here: " + args.only);
    return out;
}

void print(const Arguments& args, const TriMesh& mesh, const Method& method, const Contender& times,
           bool alone) {
    const double faces = static_cast<double>(mesh.triangles.size());
    std::vector<double> wall = times.wall, cpu = times.cpu;
    std::sort(wall.begin(), wall.end());
    std::sort(cpu.begin(), cpu.end());
    fmt::print(
        R"({{"program": "{}", "task": "curvature", "input": "{}", "threads": {}, "faces": {}, )"
        R"("vertices": {}, "seconds_median": {:.6f}, "seconds_min": {:.6f}, "cpu_seconds_median": {:.6f}, )"
        R"("runs": {}, "ns_per_face": {:.2f}, "peak_bytes_per_face": {})",
        method.name, args.mesh.empty() ? args.shape : args.mesh, args.threads, mesh.triangles.size(),
        mesh.points.size(), wall[wall.size() / 2], wall[0], cpu[cpu.size() / 2], wall.size(),
        wall[0] * 1e9 / faces, alone ? fmt::format("{:.1f}", peak_bytes() / faces) : "null");
    if (!args.shape.empty()) {
        const CurvatureErrors e = curvature_errors(parse_shape(args.shape), mesh, method.result.H,
                                                   method.result.K, method.result.flags);
        fmt::print(R"(, "mean_rms": {:.4g}, "mean_max": {:.4g}, "gauss_rms": {:.4g}, "gauss_max": {:.4g}, )"
                   R"("left_out": {})",
                   e.mean_rms, e.mean_max, e.gauss_rms, e.gauss_max, e.left_out);
    }
    fmt::print("}}\n");
}

void run(const Arguments& args) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(args.threads));
    const TriMesh mesh =
        args.mesh.empty() ? make_curved_mesh(parse_shape(args.shape), *args.faces) : read_mesh(args.mesh);
    std::optional<DensityMap> map;
    if (!args.map.empty()) map = read_map(args.map).map;
    std::vector<Method> methods = methods_of(args, mesh, map);
    std::vector<Contender> contenders;
    for (Method& method : methods)
        contenders.push_back({method.name,
                              [&method, &mesh] {
                                  method.result = {};
                                  method.result = method.run();
                                  return Output{mesh.triangles.size(), mesh.points.size(), nullptr};
                              },
                              {},
                              {}});
    race(contenders, args.repeat);
    for (std::size_t i = 0; i < methods.size(); ++i)
        print(args, mesh, methods[i], contenders[i], methods.size() == 1);
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
