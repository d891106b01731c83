// Hyperdiffusion against the memory floor of a step, an OpenVDB accessor loop, and its own steppers.
#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "tests/bench/harness.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/flow/hyperdiffusion.h"
#include "vdbgeo/stencil/diffusion_sweep.h"
#include "vdbgeo/stencil/diffusivity.h"
#include "vdbgeo/stencil/plane_kernels.h"

using namespace vdbgeo;
using namespace vdbgeo::bench;
using openvdb::Coord;

namespace {

constexpr const char* usage =
    "bench_diffusion [SIZE ...]   voxels along an axis (256 512)\n"
    "  --threads T                2\n"
    "  --repeat R                 5 timed rounds\n"
    "  --accessor-size N          box of the OpenVDB accessor loop (128); 0: none\n"
    "  --solution-size N          box in which the steppers are compared (64); 0: none\n";

struct Arguments {
    std::vector<int> sizes;
    int threads = 2, repeat = 5, accessor_size = 128, solution_size = 64;
};

Arguments parse(int count, char** words) {
    Arguments a;
    for (int i = 1; i < count; ++i) {
        const std::string word = words[i];
        const auto value = [&] {
            if (++i == count) throw InvalidInput(word + " needs a value");
            return std::stoi(words[i]);
        };
        if (word == "--threads")
            a.threads = value();
        else if (word == "--repeat")
            a.repeat = value();
        else if (word == "--accessor-size")
            a.accessor_size = value();
        else if (word == "--solution-size")
            a.solution_size = value();
        else if (word[0] != '-')
            a.sizes.push_back(std::stoi(word));
        else
            throw InvalidInput(fmt::format("unknown word '{}'\n{}", word, usage));
    }
    if (a.sizes.empty()) a.sizes = {256, 512};
    if (a.threads < 1 || a.repeat < 1) throw InvalidInput("--threads and --repeat begin at 1");
    if (*std::min_element(a.sizes.begin(), a.sizes.end()) < 8) throw InvalidInput("a size is 8 or more");
    return a;
}

/// White noise in [0, 1), a function of the voxel alone.
float noise_at(const Coord& c) {
    auto h = static_cast<std::uint32_t>(c.x()) * 0x9e3779b1u ^
             static_cast<std::uint32_t>(c.y()) * 0x85ebca77u ^
             static_cast<std::uint32_t>(c.z()) * 0xc2b2ae3du;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return static_cast<float>(h >> 8) * 0x1p-24f;
}

/// Noise in a cube, or in shells of 6.4 voxels, 64 apart, around its middle: a tenth of it.
openvdb::FloatGrid::Ptr noise_grid(int size, bool band) {
    constexpr double period = 64, half_width = 3.2;
    const auto grid = openvdb::FloatGrid::create(0);
    const openvdb::Vec3d middle(0.5 * size);
    for (int x = 0; x < size; x += 8)
        for (int y = 0; y < size; y += 8)
            for (int z = 0; z < size; z += 8) {
                auto leaf = std::make_unique<openvdb::FloatTree::LeafNodeType>(Coord(x, y, z), 0.0f, false);
                for (openvdb::Index i = 0; i < 512; ++i) {
                    const Coord c = leaf->offsetToGlobalCoord(i);
                    const double r = (c.asVec3d() - middle).length();
                    if (!band || std::abs(std::fmod(r, period) - period / 2) < half_width)
                        leaf->setValueOn(i, noise_at(c));
                }
                if (!leaf->isEmpty()) grid->tree().addLeaf(leaf.release());
            }
    return grid;
}

double median_of(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

/// Fields on the bricks of a grid, and what is timed on them.
class Bricks {
 public:
    explicit Bricks(const openvdb::FloatGrid& grid)
        : layout_(grid.tree()), u_(layout_), before_(layout_), d_(layout_.brick_count()) {
        stencil::load(layout_, grid.tree(), 0, u_.now());
        stencil::load(layout_, grid.tree(), 0, before_.now());
        coefficients(0, 2);
    }
    std::size_t bricks() const { return layout_.brick_count(); }
    std::uint64_t active() const { return layout_.active_count(); }

    /// What a step of order 0 must move: three numbers read and one written, 16 bytes.
    void floor() {
        float *u = u_.now(), *before = before_.now();
        parallel_for(bricks(), 256, [&](std::size_t b) {
            const std::size_t at = b * 512;
            const float *p = before + at, *d = d_.brick(b);
            float* out = u + at;
            for (int k = 0; k < 512; ++k) out[k] = 0.5f * out[k] + p[k] * d[k];
        });
    }
    /// As many steps in the middle of a cycle as fit into one pass.
    void sweep(int order) {
        stencil::SweepPlan plan;
        stencil::SweepField field;
        field.terms = {{order, d_.brick(0), 1.0}};
        field.state = &u_;
        field.before = &before_;
        plan.fields = {field};
        const double tau = 1.8 / std::pow(12.0, order + 1);
        for (int k = 0; k < stencil::steps_per_sweep(order); ++k)
            plan.steps.push_back({(4.0 * k + 2) / (2.0 * k + 3), tau});
        plan.begins = plan.ends = false;
        stencil::sweep(layout_, plan);
    }
    /// The diffusivity of an order; radius 0: one σ for the grid, which is found too.
    void coefficients(int order, int radius) {
        stencil::Diffusivity o;
        o.radius = radius;
        o.of_gradient = order > 0;
        o.floor = 1e-12;
        if (radius == 0)
            o.sigma_squared =
                std::max(o.floor, order > 0 ? stencil::gradient_variance(layout_, u_.now(), Vec3d::Ones())
                                            : stencil::summarize(layout_, u_.now()).variance());
        stencil::diffusivity(layout_, u_.now(), Vec3d::Ones(), o, d_.brick(0));
    }

 private:
    stencil::BlockLayout layout_;
    stencil::ShiftedField u_, before_;
    stencil::BlockField d_;
};

Contender named(const std::string& name, const std::function<void()>& body) {
    return {name,
            [body] {
                body();
                return Output{};
            },
            {},
            {}};
}

/// One JSON line: nanoseconds a voxel and step, and what they are in floors and in steps of order 0.
void print_pass(const Arguments& args, int size, const std::string& domain, const std::string& program,
                double ns, std::optional<double> floor, std::optional<double> step) {
    const auto ratio = [&](const std::optional<double>& to) {
        return to ? fmt::format("{:.3f}", ns / *to) : "null";
    };
    fmt::print(R"({{"task": "pass", "size": {}, "domain": "{}", "program": "{}", "threads": {}, )"
               R"("kernels": "{}", "ns_per_voxel": {:.4f}, "floors": {}, "steps": {}}})"
               "\n",
               size, domain, program, args.threads, stencil::kernels().name, ns, ratio(floor), ratio(step));
    std::fflush(stdout);
}

void print_memory(const openvdb::FloatGrid& grid, int size, const std::string& domain) {
    for (const bool variable : {true, false}) {
        HyperdiffusionOptions o;
        o.steps = 1;
        o.min_cycles = 1;
        if (!variable) o.sigma.kind = EdgeScale::Kind::infinite;
        const auto copy = grid.deepCopy();
        const HyperdiffusionReport r = hyperdiffuse(*copy, o);
        fmt::print(R"({{"task": "memory", "size": {}, "domain": "{}", "program": "order 1, {}", )"
                   R"("active_voxels": {}, "bytes_per_voxel": {:.2f}}})"
                   "\n",
                   size, domain, variable ? "edges kept" : "constant", r.active_voxels,
                   static_cast<double>(r.state_bytes) / static_cast<double>(r.active_voxels));
    }
}

void bench_passes(const Arguments& args, int size, bool band) {
    const std::string domain = band ? "band" : "all";
    auto grid = noise_grid(size, band);
    print_memory(*grid, size, domain);
    Bricks bricks(*grid);
    grid.reset();
    struct Pass {
        std::string name;
        int order, steps;  // of the sweep that it is compared with; steps it takes
    };
    std::vector<Pass> passes{{"floor, 16 bytes", 0, 1}};
    std::vector<Contender> contenders{named("floor", [&] { bricks.floor(); })};
    for (int q = 0; q <= 3; ++q) {
        passes.push_back({fmt::format("step, order {}", q), q, stencil::steps_per_sweep(q)});
        contenders.push_back(named("sweep", [&bricks, q] { bricks.sweep(q); }));
    }
    for (const int radius : {2, 0})
        for (const int q : {0, 1}) {
            passes.push_back(
                {fmt::format("diffusivity, order {}, {}", q, radius ? "local:2" : "global"), q, 1});
            contenders.push_back(
                named("diffusivity", [&bricks, q, radius] { bricks.coefficients(q, radius); }));
        }
    race(contenders, args.repeat);
    const auto ns = [&](std::size_t i, double voxels) {
        return 1e9 * median_of(contenders[i].wall) / passes[i].steps / voxels;
    };
    const double active = static_cast<double>(bricks.active());
    const double floor = ns(0, static_cast<double>(bricks.bricks()) * 512);
    for (std::size_t i = 0; i < passes.size(); ++i)
        print_pass(args, size, domain, passes[i].name, i == 0 ? floor : ns(i, active), floor,
                   i == 0 ? std::nullopt
                          : std::optional<double>(ns(1 + static_cast<std::size_t>(passes[i].order), active)));
}

/// The same step of order 0 as one writes it with OpenVDB: every neighbour through an accessor.
void accessor_step(openvdb::tree::LeafManager<openvdb::FloatTree>& leaves, const openvdb::FloatTree& u,
                   const openvdb::FloatTree& d, float tau) {
    leaves.foreach ([&](openvdb::FloatTree::LeafNodeType& leaf, std::size_t number) {
        const openvdb::tree::ValueAccessor<const openvdb::FloatTree> u_at(u), d_at(d);
        float* out = leaves.getBuffer(number, 1).data();
        for (auto it = leaf.cbeginValueOn(); it; ++it) {
            const float here = *it, d_here = d_at.getValue(it.getCoord());
            float sum = 0;
            for (int face = 0; face < 6; ++face) {
                Coord c = it.getCoord();
                c[face / 2] += face % 2 ? 1 : -1;
                float there = 0;
                if (u_at.probeValue(c, there)) sum += 0.5f * (d_here + d_at.getValue(c)) * (there - here);
            }
            out[it.pos()] = here + tau * sum;
        }
    });
    leaves.swapLeafBuffer(1);
}

void bench_accessor(const Arguments& args) {
    const int size = args.accessor_size;
    const auto grid = noise_grid(size, false), d = grid->deepCopy();
    Bricks bricks(*grid);
    openvdb::tree::LeafManager<openvdb::FloatTree> leaves(grid->tree(), 1);
    std::vector<Contender> contenders{
        named("accessor", [&] { accessor_step(leaves, grid->tree(), d->tree(), 0.15f); }),
        named("sweep", [&] { bricks.sweep(0); })};
    race(contenders, args.repeat);
    const double voxels = static_cast<double>(bricks.active());
    const double step = 1e9 * median_of(contenders[1].wall) / stencil::steps_per_sweep(0) / voxels;
    print_pass(args, size, "all", "step, order 0, OpenVDB accessors",
               1e9 * median_of(contenders[0].wall) / voxels, {}, step);
    print_pass(args, size, "all", "step, order 0", step, {}, step);
}

/// A ball with a soft edge, in noise.
openvdb::FloatGrid::Ptr noisy_ball(int size) {
    const auto grid = noise_grid(size, false);
    const openvdb::Vec3d middle(0.5 * size);
    for (auto it = grid->beginValueOn(); it; ++it) {
        const double r = (it.getCoord().asVec3d() - middle).length();
        it.setValue(static_cast<float>(2 / (1 + std::exp(r - 0.3 * size)) + 0.5 * *it));
    }
    return grid;
}

/// One stepper on its way to a time.
struct Way {
    std::string name;
    Stepper stepper;
    double dt = 0;               // of Euler and ADI, in bounds
    std::optional<int> at_most;  // FSI: steps in a cycle
};

/// FSI, Euler and ADI up to the time of three FSI cycles of twenty steps, against Euler in quarters of steps.
/// The error is the root mean square of the difference over that of the change.
void bench_solution(const Arguments& args, int order, bool variable) {
    const auto input = noisy_ball(args.solution_size);
    HyperdiffusionOptions base;
    base.terms = {{order, 1.0}};
    base.sigma.kind = variable ? EdgeScale::Kind::global : EdgeScale::Kind::infinite;
    const double bound = 2 / base.largest_rate(Vec3d::Ones());
    constexpr int cycle = 20;
    base.time = 3 * (0.9 * bound) * cycle * (cycle + 1) / 3;
    const auto solve = [&](const Way& way, HyperdiffusionReport& report) {
        HyperdiffusionOptions o = base;
        o.stepper = way.stepper;
        if (way.stepper != Stepper::fsi) o.dt = way.dt * bound;
        o.cycle = way.at_most;
        const auto grid = input->deepCopy();
        report = hyperdiffuse(*grid, o);
        return grid;
    };
    HyperdiffusionReport report;
    const auto exact = solve({"", Stepper::euler, 0.225, {}}, report);
    const auto distance = [&](const openvdb::FloatGrid& a) {
        double sum = 0;
        for (auto it = a.cbeginValueOn(); it; ++it)
            sum += std::pow(double(*it) - exact->tree().getValue(it.getCoord()), 2);
        return std::sqrt(sum);
    };
    const double change = distance(*input);
    const std::vector<Way> ways{
        {"euler", Stepper::euler, 0.9, {}},           {"fsi, n = 20", Stepper::fsi, 0, cycle},
        {"fsi, n = 10", Stepper::fsi, 0, cycle / 2},  {"fsi, n = 5", Stepper::fsi, 0, cycle / 4},
        {"adi, dt = 5 bounds", Stepper::adi, 5, {}},  {"adi, dt = 20 bounds", Stepper::adi, 20, {}},
        {"adi, dt = 80 bounds", Stepper::adi, 80, {}}};
    for (const Way& way : ways) {
        std::vector<double> seconds;
        double error = 0;
        for (int i = 0; i <= args.repeat; ++i) {
            const auto begin = std::chrono::steady_clock::now();
            const auto grid = solve(way, report);
            seconds.push_back(
                std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
            if (i == 0) error = distance(*grid) / change;
        }
        seconds.erase(seconds.begin());
        fmt::print(
            R"({{"task": "solution", "size": {}, "order": {}, "coefficients": "{}", "program": "{}", )"
            R"("threads": {}, "time": {:.6g}, "applications": {}, "seconds": {:.6f}, "error": {:.3e}}})"
            "\n",
            args.solution_size, order, variable ? "edges kept" : "constant", way.name, args.threads,
            report.time, report.steps, median_of(seconds), error);
        std::fflush(stdout);
    }
}

void run(const Arguments& args) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(args.threads));
    for (const int size : args.sizes)
        for (const bool band : {false, true}) bench_passes(args, size, band);
    if (args.accessor_size > 0) bench_accessor(args);
    if (args.solution_size <= 0) return;
    for (const int order : {0, 1})
        for (const bool variable : {false, true}) bench_solution(args, order, variable);
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
