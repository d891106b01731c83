// Writes an int16 tomogram of any size, section by section: vesicles, filaments and blobs in noisy solvent.
// It stands for what is larger than memory and mostly empty.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include "converters/mrc_header.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/types.h"

namespace {

using namespace vdbgeo;

constexpr int occupied_above = 150;
constexpr double solvent_sigma = 20, matter_sigma = 40;

struct Options {
    std::string output;
    std::array<int, 3> size{2048, 2048, 1024};
    double fraction = 0.05;
    std::uint64_t seed = 1;
    bool clean = false;
};

/// A set of x between two ends; empty where first > last.
struct Span {
    double first = 0, last = -1;
};

/// Roots of a·x² + 2·b·x + c ≤ 0, a > 0.
Span quadratic_span(double a, double b, double c) {
    const double d = b * b - a * c;
    if (d < 0) return {};
    const double root = std::sqrt(d);
    return {(-b - root) / a, (-b + root) / a};
}

/// One thing of one density. All lengths in voxels.
struct Shape {
    enum class Kind { blob, vesicle, filament } kind = Kind::blob;
    Vec3d centre = Vec3d::Zero();
    Vec3d direction = Vec3d::UnitX();  // of a filament, which is a cylinder
    double radius = 0;
    double inner = 0;   // radius of what a vesicle encloses
    double length = 0;  // of a filament
    std::int16_t density = 0;

    double volume() const {
        const double ball = 4.0 / 3.0 * M_PI * (radius * radius * radius - inner * inner * inner);
        return kind == Kind::filament ? M_PI * radius * radius * length : ball;
    }
    double reach_z() const {
        return radius + (kind == Kind::filament ? 0.5 * length * std::fabs(direction.z()) : 0);
    }
    double reach_y() const {
        return radius + (kind == Kind::filament ? 0.5 * length * std::fabs(direction.y()) : 0);
    }

    /// The x of a row inside a ball about the centre.
    Span ball_span(double r, double y, double z) const {
        const double dy = y - centre.y(), dz = z - centre.z();
        return quadratic_span(1, -centre.x(), centre.x() * centre.x() + dy * dy + dz * dz - r * r);
    }

    /// The x of a row inside the cylinder.
    Span cylinder_span(double y, double z) const {
        // With q = (x, y, z) − centre: |q|² − (q·d)² ≤ r², and |q·d| ≤ length / 2.
        const Vec3d q(-centre.x(), y - centre.y(), z - centre.z());
        const double along = q.dot(direction), dx = direction.x();
        Span s = quadratic_span(1 - dx * dx, q.x() - along * dx,
                                q.squaredNorm() - along * along - radius * radius);
        const double a = (-length / 2 - along) / dx, b = (length / 2 - along) / dx;
        return {std::max(s.first, std::min(a, b)), std::min(s.last, std::max(a, b))};
    }
};

std::vector<Shape> make_shapes(const Options& options) {
    std::mt19937_64 random(options.seed);
    const auto between = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    const auto [nx, ny, nz] = options.size;
    const auto make = [&](Shape::Kind kind) {
        Shape s;
        s.kind = kind;
        s.density = static_cast<std::int16_t>(between(300, 1200));
        if (kind == Shape::Kind::blob) s.radius = between(4, 12);
        if (kind == Shape::Kind::vesicle) {
            s.radius = between(20, 80);
            s.inner = s.radius - 5;
        }
        if (kind == Shape::Kind::filament) {
            s.radius = between(3, 6);
            s.length = between(100, 400);
            const double angle = between(0, 2 * M_PI), z = between(-0.4, 0.4);
            s.direction = Vec3d(std::cos(angle), std::sin(angle), z).normalized();
        }
        return s;
    };
    // Centres lie in the box and as far outside as they matter, so that the borders are like the rest. Where
    // N voxels are hit by shapes of volume V at random, 1 − exp(−V/N) of them are in one.
    const double wanted = -std::log1p(-options.fraction) / 3;
    std::vector<Shape> shapes;
    for (const Shape::Kind kind : {Shape::Kind::blob, Shape::Kind::vesicle, Shape::Kind::filament}) {
        const double pad = kind == Shape::Kind::blob ? 12 : kind == Shape::Kind::vesicle ? 80 : 206;
        const double room = (nx + 2 * pad) * (ny + 2 * pad) * (nz + 2 * pad);
        for (double volume = 0; volume < wanted * room;) {
            Shape s = make(kind);
            s.centre = {between(-pad, nx + pad), between(-pad, ny + pad), between(-pad, nz + pad)};
            volume += s.volume();
            shapes.push_back(s);
        }
    }
    return shapes;
}

/// Four 16-bit numbers of a hash added up: a bell of variance 1 that ends at ±3.46.
double bell(std::uint64_t seed, std::uint64_t index) {
    std::uint64_t h = (index + seed * 0x632be59bd9b4e019u) * 0x9e3779b97f4a7c15u;
    h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9u;
    h = (h ^ (h >> 27)) * 0x94d049bb133111ebu;
    h ^= h >> 31;
    const std::uint64_t sum = (h & 0xffff) + (h >> 16 & 0xffff) + (h >> 32 & 0xffff) + (h >> 48);
    return (static_cast<double>(sum) - 131070) / 37837.2;
}

struct Totals {
    std::int64_t occupied = 0, sum = 0, squares = 0;
    std::int16_t min = 32767, max = -32768;

    void join(const Totals& t) {
        occupied += t.occupied;
        sum += t.sum;
        squares += t.squares;
        min = std::min(min, t.min);
        max = std::max(max, t.max);
    }
};

class Tomogram {
 public:
    explicit Tomogram(const Options& options) : options_(options), shapes_(make_shapes(options)) {
        at_.resize(static_cast<std::size_t>(options.size[2]));
        for (std::size_t i = 0; i < shapes_.size(); ++i) {
            const Shape& s = shapes_[i];
            const int first = static_cast<int>(std::max(0.0, std::ceil(s.centre.z() - s.reach_z())));
            const int last =
                static_cast<int>(std::min(options.size[2] - 1.0, std::floor(s.centre.z() + s.reach_z())));
            for (int z = first; z <= last; ++z) at_[static_cast<std::size_t>(z)].push_back(i);
        }
    }

    std::size_t section_size() const {
        return static_cast<std::size_t>(options_.size[0]) * static_cast<std::size_t>(options_.size[1]);
    }

    Totals section(int z, std::int16_t* out) const {
        std::fill(out, out + section_size(), std::int16_t(0));
        for (const std::size_t i : at_[static_cast<std::size_t>(z)]) draw(shapes_[i], z, out);
        if (!options_.clean) add_noise(z, out);
        Totals t;
        for (std::size_t i = 0; i < section_size(); ++i) {
            const std::int64_t v = out[i];
            t.occupied += v > occupied_above;
            t.sum += v;
            t.squares += v * v;
            t.min = std::min(t.min, out[i]);
            t.max = std::max(t.max, out[i]);
        }
        return t;
    }

 private:
    void draw(const Shape& s, int z, std::int16_t* out) const {
        const int ny = options_.size[1];
        const int first = static_cast<int>(std::max(0.0, std::ceil(s.centre.y() - s.reach_y())));
        const int last = static_cast<int>(std::min(ny - 1.0, std::floor(s.centre.y() + s.reach_y())));
        for (int y = first; y <= last; ++y) {
            std::int16_t* row =
                out + static_cast<std::size_t>(y) * static_cast<std::size_t>(options_.size[0]);
            if (s.kind == Shape::Kind::filament) {
                fill(row, s.cylinder_span(y, z), s.density);
                continue;
            }
            const Span outer = s.ball_span(s.radius, y, z), hole = s.ball_span(s.inner, y, z);
            if (hole.first > hole.last || s.inner == 0) {
                fill(row, outer, s.density);
            } else {
                fill(row, {outer.first, hole.first}, s.density);
                fill(row, {hole.last, outer.last}, s.density);
            }
        }
    }

    /// The denser of two things that overlap is seen.
    void fill(std::int16_t* row, const Span& span, std::int16_t density) const {
        const int nx = options_.size[0];
        const int first = static_cast<int>(std::ceil(std::clamp(span.first, 0.0, static_cast<double>(nx))));
        const int last = static_cast<int>(std::floor(std::clamp(span.last, -1.0, nx - 1.0)));
        for (int x = first; x <= last; ++x) row[x] = std::max(row[x], density);
    }

    void add_noise(int z, std::int16_t* out) const {
        const std::uint64_t start = static_cast<std::uint64_t>(z) * section_size();
        for (std::size_t i = 0; i < section_size(); ++i) {
            const double sigma = out[i] ? matter_sigma : solvent_sigma;
            out[i] = static_cast<std::int16_t>(out[i] + std::lrint(sigma * bell(options_.seed, start + i)));
        }
    }

    Options options_;
    std::vector<Shape> shapes_;
    std::vector<std::vector<std::size_t>> at_;  // shapes that meet each section
};

MrcHeaderBytes header_of(const Options& options, const Totals& totals) {
    MrcHeader h;
    h.nx = h.mx = options.size[0];
    h.ny = h.my = options.size[1];
    h.nz = h.mz = options.size[2];
    h.mode = 1;
    h.cell = {10.0f * static_cast<float>(h.nx), 10.0f * static_cast<float>(h.ny),
              10.0f * static_cast<float>(h.nz)};
    const double n = static_cast<double>(h.nx) * h.ny * h.nz, mean = static_cast<double>(totals.sum) / n;
    h.dmin = totals.min;
    h.dmax = totals.max;
    h.dmean = static_cast<float>(mean);
    h.rms =
        static_cast<float>(std::sqrt(std::max(0.0, static_cast<double>(totals.squares) / n - mean * mean)));
    h.nversion = 20140;
    h.map = {'M', 'A', 'P', ' '};
    h.machst = {0x44, 0x44, 0, 0};
    h.labels = {"vdbgeo make_tomogram"};
    h.nlabl = 1;
    return encode_mrc_header(h);
}

Totals write(const Options& options) {
    constexpr int slab = 16;
    const Tomogram tomogram(options);
    AtomicFile file(options.output);
    Totals totals;
    MrcHeaderBytes header = header_of(options, totals);
    file.write(header.data(), header.size());
    std::vector<std::int16_t> sections(tomogram.section_size() * slab);
    for (int z = 0; z < options.size[2]; z += slab) {
        const auto count = static_cast<std::size_t>(std::min(slab, options.size[2] - z));
        totals.join(fixed_order_reduce(
            count, 1, Totals{},
            [&](std::size_t i, std::size_t) {
                return tomogram.section(z + static_cast<int>(i),
                                        sections.data() + i * tomogram.section_size());
            },
            [](Totals& all, const Totals& one) { all.join(one); }));
        file.write(sections.data(), count * tomogram.section_size() * sizeof(std::int16_t));
    }
    header = header_of(options, totals);
    file.stream().seekp(0);
    file.write(header.data(), header.size());
    file.commit();
    return totals;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app(
        "Writes an int16 tomogram (MRC2014, mode 1, 10 Å voxels): vesicles, filaments and blobs of density "
        "300 to "
        "1200 in solvent about 0, and prints how much of it lies above 150. Same options, same bytes.");
    Options options;
    bool noise = false;
    app.add_option("output", options.output, "the map")->required();
    app.add_option("--size", options.size, "samples along x, y, z")
        ->capture_default_str()
        ->check(CLI::Range(1, 32767));
    app.add_option("--fraction", options.fraction, "share of the volume that is occupied")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 0.9));
    app.add_option("--seed", options.seed, "another number, another tomogram")->capture_default_str();
    auto* clean = app.add_flag("--clean", options.clean, "no noise: solvent is 0");
    app.add_flag("--noise", noise, "noise of sigma 20 in solvent and 40 in matter (the default)")
        ->excludes(clean);
    CLI11_PARSE(app, argc, argv);
    try {
        const Totals t = write(options);
        const double n = static_cast<double>(options.size[0]) * options.size[1] * options.size[2];
        fmt::print(
            R"({{"output": "{}", "samples": {:.0f}, "occupied": {}, "fraction": {:.6f}, "min": {}, "max": {}}})"
            "\n",
            options.output, n, t.occupied, static_cast<double>(t.occupied) / n, t.min, t.max);
    } catch (const IoError& error) {
        std::cerr << "make_tomogram: error: " << error.what() << "\n";
        return 4;
    }
}
