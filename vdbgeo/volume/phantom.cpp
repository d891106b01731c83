#include "vdbgeo/volume/phantom.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

constexpr double pi = 3.14159265358979323846;

/// An analytic kind: its parameters' defaults (unset: the kind does not take it), and its field.
struct Shape {
    PhantomKind kind;
    std::optional<double> radius, minor_radius, height, period;
    std::function<double(const Vec3d&, const Shape&)> field;
    std::function<double(const Shape&)> extent;  ///< 80 % of the default width of the box, in Å
};

const std::vector<Shape>& shapes() {
    static const std::vector<Shape> table = {
        {{"sphere", "ball, signed distance"},
         100.0,
         {},
         {},
         {},
         [](const Vec3d& p, const Shape& s) { return sphere_field(p, *s.radius); },
         [](const Shape& s) { return 2 * *s.radius; }},
        {{"torus", "torus around z, signed distance"},
         100.0,
         40.0,
         {},
         {},
         [](const Vec3d& p, const Shape& s) { return torus_field(p, *s.radius, *s.minor_radius); },
         [](const Shape& s) { return 2 * (*s.radius + *s.minor_radius); }},
        {{"cylinder", "closed cylinder along z, signed distance"},
         60.0,
         {},
         160.0,
         {},
         [](const Vec3d& p, const Shape& s) { return cylinder_field(p, *s.radius, *s.height); },
         [](const Shape& s) { return std::max(2 * *s.radius, *s.height); }},
        {{"saddle", "saddle z = (x² - y²) / 2a, open at the box"},
         100.0,
         {},
         {},
         {},
         [](const Vec3d& p, const Shape& s) { return saddle_field(p, *s.radius); },
         [](const Shape& s) { return 0.8 * 2 * *s.radius; }},
        {{"catenoid", "catenoid with neck radius c, a minimal surface, open at the box"},
         40.0,
         {},
         {},
         {},
         [](const Vec3d& p, const Shape& s) { return catenoid_field(p, *s.radius); },
         [](const Shape& s) { return 0.8 * 6 * *s.radius; }},
        {{"gyroid", "gyroid, periodic, open at the box"},
         {},
         {},
         {},
         100.0,
         [](const Vec3d& p, const Shape& s) { return gyroid_field(p, *s.period); },
         [](const Shape& s) { return 0.8 * 2 * *s.period; }}};
    return table;
}

const Shape* find_shape(const std::string& kind) {
    for (const Shape& shape : shapes())
        if (shape.kind.name == kind) return &shape;
    return nullptr;
}

bool is_specimen(const std::string& kind) {
    const auto& kinds = specimen_kinds();
    return std::any_of(kinds.begin(), kinds.end(), [&](const PhantomKind& k) { return k.name == kind; });
}

void check_length(const char* name, const std::optional<double>& value) {
    if (value && !(*value >= 1e-6 && *value <= 1e6))
        throw InvalidInput(fmt::format("phantom: {} must be 1e-6 to 1e6 Å, not {}", name, *value));
}

/// `value` where it is set, else the kind's default; checked.
std::optional<double> parameter(const std::string& kind, const char* name, const std::optional<double>& value,
                                const std::optional<double>& standard) {
    check_length(name, value);
    if (value && !standard)
        throw InvalidInput(fmt::format("phantom: {} has no meaning for kind \"{}\"", name, kind));
    return value ? value : standard;
}

/// The shape with the parameters asked for.
Shape shape_of(const PhantomOptions& o, const Shape& standard) {
    Shape shape = standard;
    shape.radius = parameter(o.kind, "radius", o.radius, standard.radius);
    shape.minor_radius = parameter(o.kind, "minor_radius", o.minor_radius, standard.minor_radius);
    shape.height = parameter(o.kind, "height", o.height, standard.height);
    shape.period = parameter(o.kind, "period", o.period, standard.period);
    if (shape.minor_radius && *shape.minor_radius >= *shape.radius)
        throw InvalidInput(fmt::format("phantom: the torus needs minor_radius ({} Å) below radius ({} Å)",
                                       *shape.minor_radius, *shape.radius));
    return shape;
}

double voxel_size_of(const PhantomOptions& o, double extent) {
    return o.voxel_size ? *o.voxel_size : extent / (0.8 * (o.size - 1));
}

using Rows = std::function<void(int z, int y0, int y1, float* out)>;

Rows shape_rows(const Shape& shape, int size, double voxel) {
    return [shape, size, voxel](int z, int y0, int y1, float* out) {
        const double middle = (size - 1) / 2.0;
        for (int y = y0; y < y1; ++y)
            for (int x = 0; x < size; ++x) {
                const Vec3d p(x - middle, y - middle, z - middle);
                *out++ = static_cast<float>(shape.field(voxel * p, shape));
            }
    };
}

/// gyroid_field from the sines and cosines along one axis, which are those along every axis: six library
/// calls a sample would be most of the time.
Rows gyroid_rows(double period, int size, double voxel) {
    std::vector<double> sines, cosines;
    for (int i = 0; i < size; ++i) {
        const double angle = voxel * (i - (size - 1) / 2.0) * (2 * pi / period);
        sines.push_back(std::sin(angle));
        cosines.push_back(std::cos(angle));
    }
    return [sines, cosines](int z, int y0, int y1, float* out) {
        const double sz = sines[static_cast<std::size_t>(z)], cz = cosines[static_cast<std::size_t>(z)];
        for (int y = y0; y < y1; ++y) {
            const double sy = sines[static_cast<std::size_t>(y)], cy = cosines[static_cast<std::size_t>(y)];
            for (std::size_t x = 0; x < sines.size(); ++x)
                *out++ = static_cast<float>(sines[x] * cy + sy * cz + sz * cosines[x]);
        }
    };
}

std::uint64_t mix(std::uint64_t h) {
    h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9u;
    h = (h ^ (h >> 27)) * 0x94d049bb133111ebu;
    return h ^ (h >> 31);
}

/// The noise of voxels (2 pair, y, z) and (2 pair + 1, y, z). Single precision is enough: the values are
/// added to floats.
std::pair<float, float> noise_pair(std::uint64_t mixed_seed, std::uint64_t pair, std::uint64_t y,
                                   std::uint64_t z) {
    const std::uint64_t counter = pair | y << 21 | z << 42;
    const std::uint64_t h = mix(mix(counter + 0x9e3779b97f4a7c15u) ^ mixed_seed);
    const float u = (static_cast<float>(h >> 32) + 0.5f) * 0x1p-32f;
    const float angle = static_cast<float>(h & 0xffffffffu) * static_cast<float>(2 * pi * 0x1p-32);
    const float radius = std::sqrt(-2 * std::log(u));
    return {radius * std::cos(angle), radius * std::sin(angle)};
}

std::uint64_t mix_seed(std::uint64_t seed) { return mix(seed + 0x9e3779b97f4a7c15u); }

void add_noise_row(std::uint64_t mixed_seed, int size, int y, int z, float sigma, float* row) {
    for (int x = 0; x < size; x += 2) {
        const auto [even, odd] = noise_pair(mixed_seed, static_cast<std::uint64_t>(x / 2),
                                            static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(z));
        row[x] += sigma * even;
        if (x + 1 < size) row[x + 1] += sigma * odd;
    }
}

/// Count, mean and sum of squared deviations: joined pairwise without cancellation (Chan et al. 1979).
struct Moments {
    double count = 0, mean = 0, squares = 0;

    void join(const Moments& other) {
        if (other.count == 0) return;
        const double total = count + other.count, delta = other.mean - mean;
        squares += other.squares + delta * delta * count * other.count / total;
        mean += delta * other.count / total;
        count = total;
    }
};

}  // namespace

double sphere_field(const Vec3d& p, double radius) { return radius - p.norm(); }

double torus_field(const Vec3d& p, double radius, double minor_radius) {
    return minor_radius - std::hypot(p.head<2>().norm() - radius, p.z());
}

double cylinder_field(const Vec3d& p, double radius, double height) {
    const double side = radius - p.head<2>().norm(), cap = height / 2 - std::abs(p.z());
    if (side >= 0 && cap >= 0) return std::min(side, cap);
    return -std::hypot(std::min(side, 0.0), std::min(cap, 0.0));
}

double saddle_field(const Vec3d& p, double radius) {
    return (p.x() * p.x() - p.y() * p.y()) / (2 * radius) - p.z();
}

double catenoid_field(const Vec3d& p, double radius) {
    return radius * std::cosh(p.z() / radius) - p.head<2>().norm();
}

double gyroid_field(const Vec3d& p, double period) {
    const Vec3d q = p * (2 * pi / period);
    return std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) +
           std::sin(q.z()) * std::cos(q.x());
}

std::vector<PhantomKind> phantom_kinds() {
    std::vector<PhantomKind> kinds;
    for (const Shape& shape : shapes()) kinds.push_back(shape.kind);
    kinds.insert(kinds.end(), specimen_kinds().begin(), specimen_kinds().end());
    return kinds;
}

void PhantomOptions::check() const {
    if (size < 2 || size > 16384)
        throw InvalidInput(fmt::format("phantom: size must be 2 to 16384 samples, not {}", size));
    check_length("voxel_size", voxel_size);
    if (snr && !(std::isfinite(*snr) && *snr > 0))
        throw InvalidInput(fmt::format("phantom: snr must be positive and finite, not {}", *snr));
    const Shape* standard = find_shape(kind);
    if (!standard && !is_specimen(kind)) {
        std::string known;
        for (const PhantomKind& k : phantom_kinds()) known += (known.empty() ? "" : ", ") + k.name;
        throw InvalidInput(fmt::format("phantom: there is no kind \"{}\"; known are {}", kind, known));
    }
    const Shape shape = shape_of(*this, standard ? *standard : Shape{});
    const double half_width = standard ? voxel_size_of(*this, shape.extent(shape)) * (size - 1) / 2 : 0;
    if (kind == "catenoid" && half_width > 20 * *shape.radius)
        throw InvalidInput(fmt::format("phantom: the box may be 40 neck radii wide for a catenoid, not {}",
                                       2 * half_width / *shape.radius));
}

float voxel_noise(std::uint64_t seed, int x, int y, int z) {
    const auto [even, odd] = noise_pair(mix_seed(seed), static_cast<std::uint64_t>(x / 2),
                                        static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(z));
    return x % 2 == 0 ? even : odd;
}

Phantom::Phantom(const PhantomOptions& options, const Progress& progress) : seed_(options.seed) {
    options.check();
    const int size = options.size;
    double voxel = 0;
    if (const Shape* standard = find_shape(options.kind)) {
        const Shape shape = shape_of(options, *standard);
        voxel = voxel_size_of(options, shape.extent(shape));
        rows_ = shape.period ? gyroid_rows(*shape.period, size, voxel) : shape_rows(shape, size, voxel);
    } else {
        const std::vector<Part> parts = specimen_parts(options.kind);
        voxel = voxel_size_of(options, parts_extent(parts));
        rows_ = [field = PartField(parts, size, voxel)](int z, int y0, int y1, float* out) {
            field.rows(z, y0, y1, out);
        };
        isovalue_ = 0.5;
    }
    frame_.axes = voxel * Mat3d::Identity();
    frame_.origin = Vec3d::Constant(-voxel * (size - 1) / 2.0);
    frame_.size = Vec3i::Constant(size);
    if (options.snr) noise_sigma_ = std::sqrt(particle_variance(progress) / *options.snr);
    if (!(noise_sigma_ < 1e30))
        throw InvalidInput(
            fmt::format("phantom: snr {} asks for more noise than a float holds", *options.snr));
    progress.report(1);
}

/// Two passes, section by section: the maximum, then the variance of what is above 5 % of it.
double Phantom::particle_variance(const Progress& progress) const {
    const int size = frame_.size.x();
    const std::size_t area = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
    std::atomic<int> done{0};
    const auto section = [&](std::size_t z) {
        std::vector<float> values(area);
        rows_(static_cast<int>(z), 0, size, values.data());
        progress.report(++done / (2.0 * size));
        return values;
    };
    const auto sections_total = static_cast<std::size_t>(size);
    const float highest = fixed_order_reduce(
        sections_total, 1, -std::numeric_limits<float>::infinity(),
        [&](std::size_t z, std::size_t) {
            const std::vector<float> values = section(z);
            return *std::max_element(values.begin(), values.end());
        },
        [](float& all, float part) { all = std::max(all, part); });
    const float threshold = 0.05f * highest;
    const Moments moments = fixed_order_reduce(
        sections_total, 1, Moments{},
        [&](std::size_t z, std::size_t) {
            Moments m;
            const std::vector<float> values = section(z);
            for (const float v : values)
                if (v > threshold) m.count += 1, m.mean += v;
            if (m.count > 0) m.mean /= m.count;
            for (const float v : values)
                if (v > threshold) m.squares += (v - m.mean) * (v - m.mean);
            return m;
        },
        [](Moments& all, const Moments& part) { all.join(part); });
    if (!(highest > 0) || !(moments.squares > 0))
        throw InvalidInput(
            "phantom: snr needs a shape with more than one value inside the box; "
            "try a smaller voxel_size or a larger size");
    return moments.squares / moments.count;
}

void Phantom::evaluate(int z0, int z1, float noise_sigma, float* out) const {
    const int size = frame_.size.x();
    if (z0 < 0 || z1 > size || z0 > z1)
        throw InvalidInput(fmt::format("phantom: sections [{}, {}) are not within [0, {})", z0, z1, size));
    constexpr int rows_at_a_time = 32;
    const int bands = (size + rows_at_a_time - 1) / rows_at_a_time;
    const std::size_t count = static_cast<std::size_t>(z1 - z0) * static_cast<std::size_t>(bands);
    const std::uint64_t mixed_seed = mix_seed(seed_);
    parallel_for(count, 1, [&](std::size_t job) {
        const int section = static_cast<int>(job / static_cast<std::size_t>(bands));
        const int y0 = static_cast<int>(job % static_cast<std::size_t>(bands)) * rows_at_a_time;
        const int y1 = std::min(y0 + rows_at_a_time, size), z = z0 + section;
        const auto width = static_cast<std::size_t>(size);
        float* rows =
            out + (static_cast<std::size_t>(section) * width + static_cast<std::size_t>(y0)) * width;
        rows_(z, y0, y1, rows);
        if (noise_sigma > 0)
            for (int y = y0; y < y1; ++y, rows += width)
                add_noise_row(mixed_seed, size, y, z, noise_sigma, rows);
    });
}

void Phantom::sections(int z0, int z1, float* out) const {
    evaluate(z0, z1, static_cast<float>(noise_sigma_), out);
}

void Phantom::truth_sections(int z0, int z1, float* out) const { evaluate(z0, z1, 0, out); }

}  // namespace vdbgeo
