#include "vdbgeo/measure/isovalue_table.h"

#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/volume/enclosing_level.h"

namespace vdbgeo {
namespace {

constexpr std::uint64_t least_voxels = 8;

struct Level {
    double isovalue;
    std::uint64_t voxels;
    bool asked = false;  // by the caller: it stays whatever it costs
};

/// Voxel numbers in equal ratios, from few to many.
std::vector<std::uint64_t> voxel_numbers(std::uint64_t most, int rows) {
    const double low = static_cast<double>(std::min(least_voxels, most)), high = static_cast<double>(most);
    std::vector<std::uint64_t> numbers;
    for (int row = 0; row < rows; ++row)
        numbers.push_back(
            static_cast<std::uint64_t>(std::llround(low * std::pow(high / low, double(row) / (rows - 1)))));
    return numbers;
}

/// The samples that the lowest level encloses.
std::uint64_t most_voxels(const DensityMap& map, const IsovalueTableOptions& options) {
    const EnclosingLevels all(map, {});
    if (all.most() == 0)
        throw InvalidInput(
            "a table of isovalues needs two different values, and the map's samples are all equal");
    const auto share = static_cast<std::uint64_t>(options.largest_share * static_cast<double>(all.samples()));
    std::uint64_t most = std::clamp<std::uint64_t>(share, 1, all.most());
    const double background = map.grid->background();
    // Of a dense map the background is any value: nothing reads as it.
    if (map.frame.bounded() && map.grid->activeVoxelCount() < all.samples()) {
        const std::uint64_t above =
            voxels_above(map, {std::nextafter(static_cast<float>(background), 3e38f)})[0];
        if (above > 1) most = std::min(most, std::max<std::uint64_t>(1, above / 2));
    }
    return most;
}

std::vector<Level> choose_levels(const DensityMap& map, const IsovalueTableOptions& options,
                                 const Progress& progress) {
    const EnclosingLevels found(map, voxel_numbers(most_voxels(map, options), options.rows), progress);
    std::vector<Level> levels;
    for (const EnclosingLevels::Choice& choice : found.choices())
        if (const auto& nearest = choice.nearest()) levels.push_back({nearest->level, nearest->voxels});
    if (options.isovalue)
        levels.push_back({*options.isovalue, voxels_above(map, {*options.isovalue})[0], true});
    std::sort(levels.begin(), levels.end(), [](const Level& a, const Level& b) {
        return std::pair(-a.isovalue, !a.asked) < std::pair(-b.isovalue, !b.asked);
    });
    levels.erase(std::unique(levels.begin(), levels.end(),
                             [](const Level& a, const Level& b) { return a.isovalue == b.isovalue; }),
                 levels.end());
    return levels;
}

/// How often two neighbours along z within a leaf lie on either side of the level.
std::uint64_t crossings(const openvdb::tree::LeafManager<const openvdb::FloatTree>& leaves, double isovalue) {
    const float level = static_cast<float>(isovalue);
    return fixed_order_reduce(
        leaves.leafCount(), 1024, std::uint64_t(0),
        [&](std::size_t begin, std::size_t end) {
            std::uint64_t n = 0;
            for (std::size_t i = begin; i < end; ++i) {
                const float* const v = leaves.leaf(i).buffer().data();
                for (int row = 0; row < 512; row += 8)
                    for (int z = row; z < row + 7; ++z) n += (v[z] >= level) != (v[z + 1] >= level);
            }
            return n;
        },
        [](std::uint64_t& sum, std::uint64_t part) { sum += part; });
}

/// About how many triangles the surface has: two for each vertex, and a vertex on each edge that crosses;
/// seven of the eight edges of a row lie within a leaf, and z is one of three directions.
double expected_triangles(std::uint64_t crossings) {
    return 2.0 * 3.0 * 8.0 / 7.0 * static_cast<double>(crossings);
}

double area_of(const TriMesh& mesh) {
    return fixed_order_reduce(
        mesh.triangles.size(), 1 << 14, 0.0,
        [&](std::size_t begin, std::size_t end) {
            double sum = 0;
            for (std::size_t i = begin; i < end; ++i) {
                const Triangle& t = mesh.triangles[i];
                const Vec3d a = mesh.points[t[0]].cast<double>();
                sum +=
                    (mesh.points[t[1]].cast<double>() - a).cross(mesh.points[t[2]].cast<double>() - a).norm();
            }
            return 0.5 * sum;
        },
        [](double& sum, double part) { sum += part; });
}

/// Pieces connected through vertices, by a union-find whose roots are the lowest vertices.
std::uint64_t components_of(const TriMesh& mesh) {
    Array<VertexId> up(mesh.points.size());
    for (std::size_t i = 0; i < up.size(); ++i) up[i] = static_cast<VertexId>(i);
    const auto root = [&](VertexId v) {
        while (up[v] != v) v = up[v] = up[up[v]];
        return v;
    };
    for (const Triangle& t : mesh.triangles)
        for (const VertexId other : {t[1], t[2]}) {
            const VertexId a = root(t[0]), b = root(other);
            up[std::max(a, b)] = std::min(a, b);
        }
    std::vector<bool> used(mesh.points.size());
    for (const Triangle& t : mesh.triangles) used[root(t[0])] = true;
    return static_cast<std::uint64_t>(std::count(used.begin(), used.end(), true));
}

}  // namespace

void IsovalueTableOptions::check() const {
    if (rows < 2 || rows > 1000) throw InvalidInput(fmt::format("rows: expected 2 to 1000, found {}", rows));
    if (isovalue && !std::isfinite(*isovalue)) throw InvalidInput("isovalue: expected a finite number");
    if (!(largest_share > 0 && largest_share <= 1))
        throw InvalidInput(
            fmt::format("largest_share: expected more than 0 and up to 1, found {}", largest_share));
}

std::vector<IsovalueRow> isovalue_table(const DensityMap& map, const IsovalueTableOptions& options,
                                        const Progress& progress) {
    options.check();
    if (map.grid->getGridClass() == openvdb::GRID_LEVEL_SET)
        throw InvalidInput("a level set holds distances: there is no table of isovalues of a density");
    const std::vector<Level> levels = choose_levels(map, options, progress.part(0, 0.2));
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(map.grid->constTree());
    std::vector<IsovalueRow> rows;
    for (std::size_t k = 0; k < levels.size(); ++k) {
        const Level& level = levels[k];
        if (!level.asked && expected_triangles(crossings(leaves, level.isovalue)) >
                                static_cast<double>(options.max_triangles))
            continue;
        const double n = static_cast<double>(levels.size()), at = static_cast<double>(k);
        const Progress part = progress.part(0.2 + 0.8 * at / n, 0.2 + 0.8 * (at + 1) / n);
        const TriMesh mesh = marching_cubes(map, {level.isovalue}, part);
        rows.push_back({level.isovalue, static_cast<double>(level.voxels) * map.frame.voxel_volume(),
                        area_of(mesh), components_of(mesh)});
    }
    progress.report(1);
    return rows;
}

}  // namespace vdbgeo
