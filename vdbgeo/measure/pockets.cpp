#include "vdbgeo/measure/pockets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/patch_rims.h"
#include "vdbgeo/measure/pocket_depth.h"
#include "vdbgeo/measure/shape_types.h"
#include "vdbgeo/measure/sublevel_basins.h"
#include "vdbgeo/measure/vertex_areas.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;
/// Of the median curvedness: what pockets and protrusions are sharper than. Chosen by looking at maps.
constexpr double pocket_share = 0.5, protrusion_share = 2, least_protrusion_share = 1.25;
/// Patches of no more vertices are roughness.
constexpr double few_vertices = 20;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::uint8_t left_out = curvature_border | curvature_cap | curvature_undefined;

/// Both kinds as one: patches where `value` (k2, or −k1) is under `level`.
struct Search {
    const TriMesh& mesh;
    const Curvatures& curvature;
    const PocketOptions& options;
    bool pocket = options.kind == PatchKind::pocket;
    Array<double> areas = vertex_areas(mesh);
    Array<double> value{};
    Array<double> excess{};  ///< over the bounds, the larger one: at most 0 in patches
    double level = 0;

    std::vector<VertexId> vertices{};    ///< in patches, rising
    std::vector<std::uint32_t> patch{};  ///< of each of them
    std::vector<Pocket> list{};          ///< by patch

    double protrusion_bound(double median) const;
    void choose_bounds(Pockets& found);
    void find_vertices(double k1_below);
    void find_patches(double min_persistence, double min_area);
    void sum_up(const std::vector<double>& depths);
    void find_rims();
    void rank(Pockets& found) const;
};

double Search::protrusion_bound(double median) const {
    const double rare = area_histogram(curvature.k1, areas, 1).p95;
    const double bound = std::isfinite(rare) ? std::min(protrusion_share * median, rare) : 0;
    return std::max(least_protrusion_share * median, bound);
}

void Search::choose_bounds(Pockets& found) {
    value.resize(mesh.points.size());
    Array<double> bend(value.size());
    parallel_for(value.size(), 1 << 12, [&](std::size_t v) {
        value[v] = pocket ? curvature.k2[v] : -curvature.k1[v];
        bend[v] = curvedness(curvature.k1[v], curvature.k2[v]);
    });
    double median = area_histogram(bend, areas, 1).median;
    if (median == 0) {  // mostly flat: of what bends
        for (double& b : bend) b = b > 0 ? b : std::numeric_limits<double>::quiet_NaN();
        median = area_histogram(bend, areas, 1).median;
    }
    if (!std::isfinite(median)) median = 0;
    found.threshold = pocket ? options.k2_below.value_or(-pocket_share * median)
                             : options.k1_above.value_or(protrusion_bound(median));
    level = pocket ? found.threshold : -found.threshold;
    found.k1_below = pocket ? options.k1_below.value_or(median) : infinity;
    const double sharp = std::max(std::abs(found.threshold), median);
    found.min_persistence = options.min_persistence.value_or(sharp);
    found.area_A2 = std::accumulate(areas.begin(), areas.end(), 0.0);
    const auto used = std::count_if(areas.begin(), areas.end(), [](double a) { return a > 0; });
    const double few = used ? few_vertices * found.area_A2 / static_cast<double>(used) : 0;
    found.min_area = options.min_area.value_or(sharp > 0 ? std::min(few, 1 / (sharp * sharp)) : few);
}

void Search::find_vertices(double k1_below) {
    excess.resize(value.size());
    parallel_for(value.size(), 1 << 12,
                 [&](std::size_t v) { excess[v] = std::max(value[v] - level, curvature.k1[v] - k1_below); });
    for (std::size_t v = 0; v < value.size(); ++v)
        if (value[v] < level && excess[v] <= 0 && !(curvature.flags[v] & left_out) &&
            std::isfinite(curvature.k1[v]) && std::isfinite(curvature.k2[v]))
            vertices.push_back(static_cast<VertexId>(v));
}

/// Basins of at least the least area, numbered as before.
void Search::find_patches(double min_persistence, double min_area) {
    std::vector<double> values;
    for (const VertexId v : vertices) values.push_back(value[v]);
    patch = sublevel_basins(mesh, vertices, values, min_persistence);
    const std::uint32_t count = patch.empty() ? 0 : *std::max_element(patch.begin(), patch.end()) + 1;
    std::vector<double> area(count, 0);
    for (std::size_t i = 0; i < vertices.size(); ++i) area[patch[i]] += areas[vertices[i]];
    std::vector<std::uint32_t> number(count, none);
    std::uint32_t kept = 0;
    for (std::uint32_t p = 0; p < count; ++p)
        if (area[p] >= min_area && area[p] > 0) number[p] = kept++;
    std::size_t to = 0;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        if (number[patch[i]] == none) continue;
        vertices[to] = vertices[i];
        patch[to++] = number[patch[i]];
    }
    vertices.resize(to);
    patch.resize(to);
    list.resize(kept);
}

/// Places are summed relative to the patch's first vertex, so that nothing cancels far from the origin.
void Search::sum_up(const std::vector<double>& depths) {
    std::vector<Vec3d> origins(list.size());
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const VertexId v = vertices[i];
        Pocket& p = list[patch[i]];
        const Vec3d at = mesh.points[v].cast<double>();
        const double area = areas[v], k1 = curvature.k1[v], k2 = curvature.k2[v];
        if (p.vertices++ == 0) origins[patch[i]] = at;
        p.area_A2 += area;
        p.centroid += area * (at - origins[patch[i]]);
        p.mean_k1 += area * k1;
        p.mean_k2 += area * k2;
        p.mean_K += area * k1 * k2;
        p.mean_depth_A += area * depths[i];
        p.depth_A = std::max(p.depth_A, depths[i]);
        p.score += area * (pocket ? depths[i] : level - value[v]);
        if (p.vertices == 1 || value[v] < value[p.extreme_vertex]) p.extreme_vertex = v;
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
        Pocket& p = list[i];
        for (double* mean : {&p.mean_k1, &p.mean_k2, &p.mean_K, &p.mean_depth_A}) *mean /= p.area_A2;
        p.mean_H = 0.5 * (p.mean_k1 + p.mean_k2);
        p.centroid = origins[i] + p.centroid / p.area_A2;
        p.extreme_k = pocket ? value[p.extreme_vertex] : -value[p.extreme_vertex];
    }
}

void Search::find_rims() {
    Array<std::uint32_t> numbers;
    numbers.assign(mesh.points.size(), 0);
    for (std::size_t i = 0; i < vertices.size(); ++i) numbers[vertices[i]] = patch[i] + 1;
    const auto rims = patch_rims(mesh, numbers, static_cast<std::uint32_t>(list.size()), excess);
    for (std::size_t i = 0; i < list.size(); ++i) {
        list[i].rims = rims[i].loops;
        list[i].mouth_length_A = rims[i].length_A;
        list[i].mouth_area_A2 = rims[i].mouth_A2.norm();
        if (list[i].mouth_area_A2 > 0) list[i].opening = rims[i].mouth_A2 / list[i].mouth_area_A2;
    }
    for (const Triangle& t : mesh.triangles) {
        if (!((curvature.flags[t[0]] | curvature.flags[t[1]] | curvature.flags[t[2]]) & left_out)) continue;
        for (const VertexId v : t)
            if (numbers[v]) list[numbers[v] - 1].touches_border = true;
    }
}

void Search::rank(Pockets& found) const {
    std::vector<std::uint32_t> order(list.size()), place(list.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return list[a].score != list[b].score ? list[a].score > list[b].score
                                              : list[a].extreme_vertex < list[b].extreme_vertex;
    });
    for (const std::uint32_t p : order) {
        found.list.push_back(list[p]);
        found.list.back().id = place[p] = static_cast<std::uint32_t>(found.list.size());
    }
    for (std::size_t i = 0; i < vertices.size(); ++i) found.id[vertices[i]] = place[patch[i]];
}

}  // namespace

void PocketOptions::check() const {
    const auto need = [](bool good, const char* name, double value, const char* what) {
        if (!good)
            throw InvalidInput(fmt::format("pockets: {} is {}, where {} is needed", name, value, what));
    };
    const std::pair<const char*, std::optional<double>> bounds[] = {{"the bound on k2", k2_below},
                                                                    {"the bound on k1", k1_above}};
    for (const auto& [name, value] : bounds)
        need(!value || std::isfinite(*value), name, value.value_or(0), "a finite number");
    need(!k1_below || *k1_below > -infinity, "the bound on k1", k1_below.value_or(0), "a number");
    need(!min_area || (*min_area >= 0 && std::isfinite(*min_area)), "the least area", min_area.value_or(0),
         "0 or more");
    need(!min_persistence || *min_persistence >= 0, "the least persistence", min_persistence.value_or(0),
         "0 or more");
    need(!ambient_radius || (*ambient_radius > 0 && std::isfinite(*ambient_radius)), "the ball's radius",
         ambient_radius.value_or(0), "more than 0");
    if (kind == PatchKind::pocket && k1_above)
        throw InvalidInput("pockets: a bound that k1 is above is one of protrusions");
    if (kind == PatchKind::protrusion && (k2_below || k1_below))
        throw InvalidInput("pockets: bounds that k1 or k2 is below are those of pockets");
}

Pockets find_pockets(const TriMesh& mesh, const Curvatures& curvature, const PocketOptions& options,
                     const Progress& progress) {
    options.check();
    if (curvature.size() != mesh.points.size() || curvature.k1.size() != mesh.points.size() ||
        curvature.k2.size() != mesh.points.size())
        throw InvalidInput(fmt::format("pockets: curvature at {} vertices of a mesh with {}",
                                       curvature.size(), mesh.points.size()));
    Pockets found;
    found.id.assign(mesh.points.size(), 0u);
    Search search{mesh, curvature, options};
    search.choose_bounds(found);
    progress.report(0.2);
    search.find_vertices(found.k1_below);
    search.find_patches(found.min_persistence, found.min_area);
    progress.report(0.5);
    const Progress deep = progress.part(0.5, 0.9);
    const std::vector<double> depths =
        options.ambient_radius ? ambient_depths(mesh, search.vertices, *options.ambient_radius, deep)
                               : hull_depths(mesh, search.vertices, deep);
    search.sum_up(depths);
    search.find_rims();
    search.rank(found);
    progress.report(1);
    return found;
}

std::vector<double> means_over(const Pockets& pockets, const std::vector<float>& values,
                               const Array<double>& areas) {
    if (values.size() != pockets.id.size() || areas.size() != pockets.id.size())
        throw InvalidInput(fmt::format("pockets: {} values and {} areas for {} vertices", values.size(),
                                       areas.size(), pockets.id.size()));
    std::vector<double> sum(pockets.list.size(), 0.0), weight(pockets.list.size(), 0.0);
    for (std::size_t v = 0; v < values.size(); ++v) {
        if (pockets.id[v] == 0 || !std::isfinite(values[v])) continue;
        sum[pockets.id[v] - 1] += values[v] * areas[v];
        weight[pockets.id[v] - 1] += areas[v];
    }
    for (std::size_t p = 0; p < sum.size(); ++p)
        sum[p] = weight[p] > 0 ? sum[p] / weight[p] : std::numeric_limits<double>::quiet_NaN();
    return sum;
}

}  // namespace vdbgeo
