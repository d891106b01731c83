#include "apps/curvature_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/measure/shape_types.h"

namespace vdbgeo::app {
namespace {

constexpr std::size_t bins = 120;

Json number(double v) { return std::isfinite(v) ? Json(v) : Json(); }

Json distribution_json(const AreaHistogram& h) {
    return {{"mean", number(h.mean)},
            {"rms", number(h.rms)},
            {"median", number(h.median)},
            {"p05", number(h.p05)},
            {"p95", number(h.p95)}};
}

template <class Value>
Array<double> at_vertices(const Curvatures& c, const Value& value) {
    Array<double> out(c.size());
    for (std::size_t v = 0; v < out.size(); ++v)
        out[v] = c.defined(v) ? value(c.k1[v], c.k2[v]) : std::numeric_limits<double>::quiet_NaN();
    return out;
}

Array<double> as_doubles(const std::vector<float>& values) { return {values.begin(), values.end()}; }

std::uint64_t with_flag(const Curvatures& c, CurvatureFlag flag) {
    return static_cast<std::uint64_t>(
        std::count_if(c.flags.begin(), c.flags.end(), [&](std::uint8_t f) { return f & flag; }));
}

/// Σ value · area over the vertices that have a value.
template <class Value>
double integral(const CurvatureReport& r, const Value& value) {
    double sum = 0;
    for (std::size_t v = 0; v < r.curvature.size(); ++v)
        if (r.curvature.defined(v)) sum += value(v) * r.areas[v];
    return sum;
}

std::string distribution_text(const char* name, const AreaHistogram& h, const char* unit) {
    return fmt::format("{:<12}{:>11.4g} mean {:>11.4g} rms {:>11.4g} median   [{:.4g}, {:.4g}] for 90 %{}{}",
                       name, h.mean, h.rms, h.median, h.p05, h.p95, *unit ? " " : "", unit);
}

}  // namespace

Array<double> as_weights(Array<double> areas) {
    for (double& a : areas) a = std::isfinite(a) ? std::max(a, 0.0) : 0;
    return areas;
}

Json curvature_json(const CurvatureReport& r) {
    const Curvatures& c = r.curvature;
    const Array<double> weights = as_weights(r.areas);
    Json j{{"vertices", c.size()},
           {"faces", r.mesh.triangles.size()},
           {"undefined", with_flag(c, curvature_undefined)},
           {"border_vertices", with_flag(c, curvature_border)},
           {"cap_vertices", with_flag(c, curvature_cap)},
           {"area_A2", integral(r, [](std::size_t) { return 1.0; })},
           {"integral_K", integral(r, [&](std::size_t v) { return c.K[v]; })},
           {"integral_H2", integral(r, [&](std::size_t v) { return c.H[v] * c.H[v]; })},
           {"flatness_per_A", r.flatness}};
    j["H_per_A"] = distribution_json(area_histogram(c.H, weights, bins));
    j["K_per_A2"] = distribution_json(area_histogram(c.K, weights, bins));
    j["k1_per_A"] = distribution_json(area_histogram(c.k1, weights, bins));
    j["k2_per_A"] = distribution_json(area_histogram(c.k2, weights, bins));
    j["shape_index"] = distribution_json(area_histogram(at_vertices(c, shape_index), weights, bins));
    j["curvedness_per_A"] = distribution_json(area_histogram(at_vertices(c, curvedness), weights, bins));
    const auto by_type = area_by_type(c, weights, r.flatness);
    Json types = Json::object();
    for (std::size_t t = 0; t < surface_type_count; ++t) {
        std::string name = name_of(static_cast<SurfaceType>(t));
        std::replace(name.begin(), name.end(), ' ', '_');
        types[name] = by_type[t];
    }
    j["area_by_type_A2"] = types;
    Json sampled = Json::object();
    for (const MeshProperty& p : r.sampled)
        sampled[p.name] = distribution_json(area_histogram(as_doubles(p.values), weights, bins));
    if (!sampled.empty()) j["sampled"] = sampled;
    return j;
}

std::vector<std::string> curvature_text(const CurvatureReport& r) {
    const Curvatures& c = r.curvature;
    const Array<double> weights = as_weights(r.areas);
    std::vector<std::string> lines{
        fmt::format("vertices    {}, {} at borders, {} on caps, {} without a value", c.size(),
                    with_flag(c, curvature_border), with_flag(c, curvature_cap),
                    with_flag(c, curvature_undefined)),
        distribution_text("H", area_histogram(c.H, weights, bins), "1/Å"),
        distribution_text("K", area_histogram(c.K, weights, bins), "1/Å²"),
        distribution_text("k1", area_histogram(c.k1, weights, bins), "1/Å"),
        distribution_text("k2", area_histogram(c.k2, weights, bins), "1/Å"),
        distribution_text("curvedness", area_histogram(at_vertices(c, curvedness), weights, bins), "1/Å"),
        distribution_text("shape index", area_histogram(at_vertices(c, shape_index), weights, bins), "")};
    for (const MeshProperty& p : r.sampled)
        lines.push_back(
            distribution_text(p.name.c_str(), area_histogram(as_doubles(p.values), weights, bins), ""));
    const auto by_type = area_by_type(c, weights, r.flatness);
    double all = 0;
    for (const double a : by_type) all += a;
    std::string types;
    for (std::size_t t = 0; t < surface_type_count; ++t)
        types += fmt::format("{}{} {:.1f} %", t ? ", " : "", name_of(static_cast<SurfaceType>(t)),
                             all > 0 ? 100 * by_type[t] / all : 0.0);
    lines.push_back(fmt::format("area        {:.6g} Å²: {}", all, types));
    lines.push_back(fmt::format("integrals   K dA {:.6g} = {:.5g} · 2π, H² dA {:.6g}",
                                integral(r, [&](std::size_t v) { return c.K[v]; }),
                                integral(r, [&](std::size_t v) { return c.K[v]; }) / (2 * M_PI),
                                integral(r, [&](std::size_t v) { return c.H[v] * c.H[v]; })));
    return lines;
}

void write_curvature_table(const CurvatureReport& r, const std::string& path, const Progress& progress) {
    const Curvatures& c = r.curvature;
    AtomicFile file(path);
    std::string head =
        "vertex,x_A,y_A,z_A,area_A2,K_per_A2,H_per_A,k1_per_A,k2_per_A,shape_index,curvedness_per_A,type,"
        "flags";
    if (c.has_directions())
        head += ",direction1_x,direction1_y,direction1_z,direction2_x,direction2_y,direction2_z";
    for (const MeshProperty& p : r.sampled) head += "," + p.name;
    file.write(head + "\n");
    fmt::memory_buffer rows;
    const auto out = std::back_inserter(rows);
    for (std::size_t v = 0; v < c.size(); ++v) {
        const Vec3f& p = r.mesh.points[v];
        fmt::format_to(out, "{},{},{},{},{:.7g},", v, p[0], p[1], p[2], r.areas[v]);
        if (c.defined(v))
            fmt::format_to(out, "{:.7g},{:.7g},{:.7g},{:.7g},{:.6g},{:.7g},{},{}", c.K[v], c.H[v], c.k1[v],
                           c.k2[v], shape_index(c.k1[v], c.k2[v]), curvedness(c.k1[v], c.k2[v]),
                           name_of(surface_type(c.k1[v], c.k2[v], r.flatness)), int(c.flags[v]));
        else
            fmt::format_to(out, ",,,,,,,{}", int(c.flags[v]));
        if (c.has_directions())
            for (const Vec3f* d : {&c.direction1[v], &c.direction2[v]})
                fmt::format_to(out, ",{:.6g},{:.6g},{:.6g}", (*d)[0], (*d)[1], (*d)[2]);
        for (const MeshProperty& s : r.sampled)
            if (std::isfinite(s.values[v]))
                fmt::format_to(out, ",{:.7g}", s.values[v]);
            else
                fmt::format_to(out, ",");
        fmt::format_to(out, "\n");
        if (rows.size() > 1 << 20 || v + 1 == c.size()) {
            file.write({rows.data(), rows.size()});
            rows.clear();
            progress.report(static_cast<double>(v + 1) / static_cast<double>(c.size()));
        }
    }
    file.commit();
}

}  // namespace vdbgeo::app
