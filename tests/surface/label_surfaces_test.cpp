// Surfaces of segmentations: every component, closed manifolds, shared borders, no staircase; and the rule by
// which a face of a cell is parted.
#include "vdbgeo/surface/label_surfaces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "converters/map_file.h"
#include "tests/support/data.h"
#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/support/sound_mesh.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/label_cells.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

using Field = std::function<int(int, int, int)>;

DensityMap label_map(const Vec3i& size, const Field& f, const Frame& frame = {}) {
    std::vector<float> values;
    for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
            for (int x = 0; x < size.x(); ++x) values.push_back(static_cast<float>(f(x, y, z)));
    return map_from_values(size, values, frame);
}

LabelSurfacesOptions rounds(int iterations) {
    LabelSurfacesOptions options;
    options.iterations = iterations;
    return options;
}

/// Mean angle between the normals of neighbouring faces, degrees.
double mean_fold(const TriMesh& mesh) {
    std::map<std::pair<VertexId, VertexId>, Vec3d> first;
    double sum = 0;
    std::size_t count = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d p = mesh.points[t[0]].cast<double>(), q = mesh.points[t[1]].cast<double>(),
                    r = mesh.points[t[2]].cast<double>(), normal = (q - p).cross(r - p).normalized();
        for (std::size_t k = 0; k < 3; ++k) {
            const auto [it, fresh] = first.try_emplace(std::minmax(t[k], t[(k + 1) % 3]), normal);
            if (fresh) continue;
            sum += std::acos(std::clamp(normal.dot(it->second), -1.0, 1.0)) * 180 / M_PI;
            ++count;
        }
    }
    return sum / static_cast<double>(count);
}

/// How many parts the voxels of one label have, edges connecting where the rule of label_cells.h joins them:
/// brute force over the faces of cells.
std::size_t voxel_components(const Vec3i& size, const Field& f, int label) {
    const auto inside = [&](const Vec3i& p) {
        return (p.array() >= 0).all() && (p.array() < size.array()).all();
    };
    const auto at = [&](const Vec3i& p) { return inside(p) ? f(p.x(), p.y(), p.z()) : 0; };
    const auto goes_first = [](int a, int b) { return a != 0 && (b == 0 || a < b); };
    const auto number = [&](const Vec3i& p) {
        return static_cast<std::size_t>(p.x() + size.x() * (p.y() + size.y() * p.z()));
    };
    std::vector<bool> seen(static_cast<std::size_t>(size.prod()));
    std::size_t count = 0;
    for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
            for (int x = 0; x < size.x(); ++x) {
                if (at({x, y, z}) != label || seen[number({x, y, z})]) continue;
                ++count;
                std::vector<Vec3i> open{{x, y, z}};
                seen[number(open[0])] = true;
                while (!open.empty()) {
                    const Vec3i p = open.back();
                    open.pop_back();
                    for (int d = 0; d < 27; ++d) {
                        const Vec3i step(d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1), q = p + step;
                        const int reach = step.cwiseAbs().sum();
                        if (reach == 0 || reach == 3 || !inside(q) || at(q) != label || seen[number(q)])
                            continue;
                        if (reach == 2) {
                            const int axis = step.x() ? 0 : 1;
                            Vec3i one = p;
                            one[axis] += step[axis];
                            const int a = at(one), b = at(p + q - one);
                            if (a != label && b != label && a == b && goes_first(a, label)) continue;
                        }
                        seen[number(q)] = true;
                        open.push_back(q);
                    }
                }
            }
    return count;
}

/// Solid components of a closed surface: its pieces with a positive volume.
std::size_t solid_pieces(const TriMesh& mesh) {
    std::vector<VertexId> to(mesh.points.size());
    for (std::size_t v = 0; v < to.size(); ++v) to[v] = static_cast<VertexId>(v);
    const auto root = [&](VertexId v) {
        while (to[v] != v) v = to[v] = to[to[v]];
        return v;
    };
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 1; k < 3; ++k) to[root(t[0])] = root(t[k]);
    std::map<VertexId, double> volume;
    for (const Triangle& t : mesh.triangles)
        volume[root(t[0])] += mesh.points[t[0]].cast<double>().dot(
            mesh.points[t[1]].cast<double>().cross(mesh.points[t[2]].cast<double>()));
    std::size_t count = 0;
    for (const auto& [piece, v] : volume) count += v > 0;
    return count;
}

using Corners = std::array<std::array<float, 3>, 3>;

std::multiset<Corners> triangles_of(const TriMesh& mesh) {
    std::multiset<Corners> out;
    for (const Triangle& t : mesh.triangles) {
        Corners c;
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t a = 0; a < 3; ++a) c[k][a] = mesh.points[t[k]][static_cast<int>(a)];
        std::sort(c.begin(), c.end());
        out.insert(c);
    }
    return out;
}

int ball(double x, double y, double z, double centre, double radius) {
    return std::hypot(x - centre, y - centre, z - centre) <= radius ? 1 : 0;
}

bool same(const TriMesh& a, const TriMesh& b) {
    return a.points.size() == b.points.size() && a.triangles.size() == b.triangles.size() &&
           std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3f)) == 0 &&
           std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)) == 0;
}

Field noise_labels(const Vec3i& size, std::uint64_t seed, int labels) {
    const auto values = noise(static_cast<std::size_t>(size.prod()), seed);
    return [=](int x, int y, int z) {
        const float v = values[static_cast<std::size_t>(x + size.x() * (y + size.y() * z))];
        return std::min(labels - 1, static_cast<int>((v + 1) / 2 * static_cast<float>(labels)));
    };
}

}  // namespace

TEST(LabelCells, TheJoinedDiagonalOfAFace) {
    // Corners of face 4 (z = 0) one after another are 0, 1, 3, 2.
    const auto parts = [](float a, float b, float c, float d) {
        return label_cell::face_parts({a, b, d, c, 0, 0, 0, 0}, 4);
    };
    EXPECT_FALSE(parts(1, 1, 0, 0).parted);
    EXPECT_FALSE(parts(1, 2, 3, 4).parted);
    EXPECT_TRUE(parts(1, 2, 3, 4).junction);
    EXPECT_TRUE(parts(1, 1, 2, 3).junction);
    using Cut = std::array<int, 2>;
    EXPECT_EQ(parts(1, 0, 1, 0).cut, (Cut{1, 3}));  // 1 joined, the zeros cut off
    EXPECT_EQ(parts(0, 1, 0, 1).cut, (Cut{0, 2}));
    EXPECT_EQ(parts(2, 1, 2, 1).cut, (Cut{0, 2}));  // the smaller of two labels
    EXPECT_EQ(parts(2, 1, 2, 3).cut, (Cut{1, 3}));  // only one diagonal is equal
    EXPECT_EQ(parts(0, 1, 0, 3).cut, (Cut{1, 3}));
}

TEST(LabelSurfaces, ABallIsSmoothAndKeepsItsVolume) {
    const Vec3i size(30, 30, 30);
    const DensityMap map = label_map(size, [](int x, int y, int z) { return ball(x, y, z, 14.5, 10); });
    const auto raw = label_surfaces(map, rounds(0)), smooth = label_surfaces(map);
    ASSERT_EQ(smooth.size(), 1u);
    EXPECT_EQ(smooth[0].label, 1);
    const MeshMeasures m = expect_closed_manifold(smooth[0].mesh), r = expect_closed_manifold(raw[0].mesh);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*r.volume_A3, map.statistics.mean * 27000,
                1e-2);  // the staircase's volume is that of the voxels
    EXPECT_NEAR(*m.volume_A3 / *r.volume_A3, 1, 0.02);
    EXPECT_NEAR(m.area_A2 / (4 * M_PI * 100), 1, 0.03);
    EXPECT_LT(mean_fold(smooth[0].mesh), mean_fold(raw[0].mesh) / 3);
    EXPECT_GT(m.min_angle_deg, 15);
    for (const Vec3f& p : smooth[0].mesh.points) EXPECT_NEAR((p - Vec3f::Constant(14.5f)).norm(), 10, 0.5);
}

TEST(LabelSurfaces, VerticesStayInTheirReach) {
    const DensityMap map =
        label_map(Vec3i(20, 20, 20), [](int x, int y, int z) { return ball(x, y, z, 9.5, 7); });
    LabelSurfacesOptions options = rounds(40);
    options.max_shift = 0.2;
    const TriMesh raw = label_surfaces(map, rounds(0))[0].mesh, moved = label_surfaces(map, options)[0].mesh;
    ASSERT_EQ(raw.points.size(), moved.points.size());
    float most = 0;
    for (std::size_t v = 0; v < raw.points.size(); ++v)
        most = std::max(most, (moved.points[v] - raw.points[v]).cwiseAbs().maxCoeff());
    EXPECT_LE(most, 0.2f);
    EXPECT_GT(most, 0.15f);
}

TEST(LabelSurfaces, ASingleVoxelIsASmallBlob) {
    const DensityMap map =
        label_map(Vec3i(5, 5, 5), [](int x, int y, int z) { return x == 2 && y == 2 && z == 2 ? 7 : 0; });
    const auto out = label_surfaces(map);
    ASSERT_EQ(out.size(), 1u);
    EXPECT_EQ(out[0].label, 7);
    const MeshMeasures m = expect_closed_manifold(out[0].mesh);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GE(*m.volume_A3, 0.12);
    EXPECT_LE(*m.volume_A3, 1);
}

TEST(LabelSurfaces, AVoxelInEveryCornerOfTheBoxIsClosed) {
    const DensityMap map = label_map(
        Vec3i(9, 9, 9), [](int x, int y, int z) { return x % 8 == 0 && y % 8 == 0 && z % 8 == 0 ? 1 : 0; });
    const MeshMeasures m = expect_closed_manifold(label_surfaces(map)[0].mesh);
    EXPECT_EQ(m.components, 8u);
}

TEST(LabelSurfaces, VoxelsThatShareAnEdgeHangTogetherByANeck) {
    for (int axis = 0; axis < 3; ++axis) {
        const DensityMap map = label_map(Vec3i(6, 6, 6), [axis](int x, int y, int z) {
            const Vec3i p(x, y, z), q(2, 2, 2);
            return p == q || p == Vec3i(q + Vec3i::Unit((axis + 1) % 3) + Vec3i::Unit((axis + 2) % 3)) ? 1
                                                                                                       : 0;
        });
        for (const int iterations : {0, 60}) {
            const MeshMeasures m = expect_closed_manifold(label_surfaces(map, rounds(iterations))[0].mesh);
            EXPECT_EQ(m.components, 1u);
            EXPECT_EQ(m.genus, 0);
            EXPECT_GT(*m.volume_A3, 0);
        }
    }
}

TEST(LabelSurfaces, VoxelsThatShareACornerOnlyAreApart) {
    const DensityMap map = label_map(
        Vec3i(6, 6, 6), [](int x, int y, int z) { return x == y && y == z && (x == 2 || x == 3) ? 1 : 0; });
    EXPECT_EQ(expect_closed_manifold(label_surfaces(map)[0].mesh).components, 2u);
}

TEST(LabelSurfaces, ATiltedMembraneOneVoxelThickKeepsItsSheetsApart) {
    const Vec3i size(40, 40, 40);
    const Field membrane = [](int x, int y, int z) {
        return x > 2 && y > 2 && x < 37 && y < 37 && z == static_cast<int>(std::round(0.4 * x + 0.3 * y + 3))
                   ? 1
                   : 0;
    };
    const DensityMap map = label_map(size, membrane);
    const auto raw = label_surfaces(map, rounds(0)), out = label_surfaces(map);
    const MeshMeasures m = expect_closed_manifold(out[0].mesh);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3 / *measure_mesh(raw[0].mesh).volume_A3, 1, 0.1);
    EXPECT_LT(mean_fold(out[0].mesh), mean_fold(raw[0].mesh) / 2.5);
}

TEST(LabelSurfaces, NeighboursShareTheirBorderBitByBit) {
    const Vec3i size(30, 30, 30);
    const DensityMap map = label_map(size, [](int x, int y, int z) {
        return ball(x, y, z, 14.5, 11) ? (x + 0.6 * y + 0.3 * z < 27 ? 3 : 5) : 0;
    });
    const auto out = label_surfaces(map);
    ASSERT_EQ(out.size(), 2u);
    const auto a = triangles_of(out[0].mesh), b = triangles_of(out[1].mesh);
    std::vector<Corners> common;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
    EXPECT_GT(common.size(), 500u);
    // What is left of both is the surface of the two together.
    double volume = 0;
    for (const LabelSurface& s : out) volume += *expect_closed_manifold(s.mesh).volume_A3;
    EXPECT_NEAR(volume / (map.statistics.count * 1.0), 4.0 / 3 * M_PI * 1331 / 27000, 0.01);
}

TEST(LabelSurfaces, EveryComponentOfNoiseInClosedManifolds) {
    const Vec3i size(17, 14, 11);
    for (const int labels : {2, 3, 4, 9})
        for (std::uint64_t seed = 1; seed < 6; ++seed) {
            const Field f = noise_labels(size, seed, labels);
            const auto raw = label_surfaces(label_map(size, f), rounds(0));
            const auto out = label_surfaces(label_map(size, f));
            ASSERT_EQ(out.size(), static_cast<std::size_t>(labels - 1));
            for (std::size_t k = 0; k < out.size(); ++k) {
                expect_closed_manifold(out[k].mesh);
                EXPECT_EQ(solid_pieces(raw[k].mesh),
                          voxel_components(size, f, static_cast<int>(out[k].label)))
                    << labels << " labels, label " << out[k].label;
            }
        }
}

TEST(LabelSurfaces, AMirroredSkewedFrameFacesOutward) {
    Frame frame;
    frame.axes << -2, 0.4, 0, 0, 3, 0.1, 0, 0, 2.5;
    frame.origin = Vec3d(100, -20, 3);
    const DensityMap map = label_map(
        Vec3i(20, 20, 20), [](int x, int y, int z) { return ball(x, y, z, 9.5, 7); }, frame);
    const MeshMeasures m = expect_closed_manifold(label_surfaces(map)[0].mesh);
    EXPECT_NEAR(*m.volume_A3 / frame.voxel_volume(), 4.0 / 3 * M_PI * 343, 60);
}

TEST(LabelSurfaces, TilesAndADenseBackgroundCountAsTheyAre) {
    const Vec3i size(40, 24, 24);
    const Field f = [](int x, int y, int z) {
        return x < 16 && y < 16 && z < 16 ? 4 : x > 30 && y > 20 ? 2 : 9;
    };
    DensityMap dense = label_map(size, f);
    for (int x = 0; x < 40; x += 8)
        for (int y = 0; y < 24; y += 8)
            for (int z = 0; z < 24; z += 8) dense.grid->tree().touchLeaf(openvdb::Coord(x, y, z));
    DensityMap sparse = dense;
    sparse.grid = openvdb::FloatGrid::create(9.0f);
    sparse.grid->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(15)), 4.0f);
    for (int x = 31; x < 40; ++x)
        for (int y = 21; y < 24; ++y)
            for (int z = 0; z < 24; ++z) sparse.grid->tree().setValue(openvdb::Coord(x, y, z), 2.0f);
    ASSERT_GT(sparse.grid->tree().activeTileCount(), 0u);
    const auto a = label_surfaces(dense), b = label_surfaces(sparse);
    ASSERT_EQ(a.size(), 3u);
    ASSERT_EQ(b.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(same(a[k].mesh, b[k].mesh)) << a[k].label;
    sparse.frame.size = Vec3i::Zero();
    EXPECT_THROW(label_surfaces(sparse), InvalidInput);
}

TEST(LabelSurfaces, OneAndTwoThreadsGiveTheSameBytesAndAChoiceChangesNothing) {
    const Vec3i size(40, 40, 40);
    const DensityMap map = label_map(size, noise_labels(size, 1, 4));
    std::vector<LabelSurface> one, two;
    with_threads(1, [&] { one = label_surfaces(map); });
    with_threads(2, [&] { two = label_surfaces(map); });
    LabelSurfacesOptions only;
    only.labels = {2};
    const auto chosen = label_surfaces(map, only);
    ASSERT_EQ(one.size(), 3u);
    for (std::size_t k = 0; k < one.size(); ++k) EXPECT_TRUE(same(one[k].mesh, two[k].mesh));
    ASSERT_EQ(chosen.size(), 1u);
    EXPECT_TRUE(same(chosen[0].mesh, one[1].mesh));
}

TEST(LabelSurfaces, WhatIsNoSegmentationIsRefused) {
    const DensityMap halves = map_from_values(Vec3i(4, 4, 4), std::vector<float>(64, 0.5f));
    EXPECT_THROW(label_surfaces(halves), InvalidInput);
    const DensityMap ones = map_from_values(Vec3i(4, 4, 4), std::vector<float>(64, 1.0f));
    LabelSurfacesOptions options;
    options.labels = {2};
    EXPECT_THROW(label_surfaces(ones, options), InvalidInput);
    options.labels = {0};
    EXPECT_THROW(label_surfaces(ones, options), InvalidInput);
    options.labels = {1, 1};
    EXPECT_THROW(label_surfaces(ones, options), InvalidInput);
    options = rounds(-1);
    EXPECT_THROW(label_surfaces(ones, options), InvalidInput);
    options.iterations = 1;
    options.max_shift = 0;
    EXPECT_THROW(label_surfaces(ones, options), InvalidInput);
    EXPECT_TRUE(label_surfaces(map_from_values(Vec3i(4, 4, 4), std::vector<float>(64, 0.0f))).empty());
}

TEST(IsLabelMap, WholeNumbersInPatchesAreLabels) {
    const Vec3i size(20, 20, 20);
    EXPECT_TRUE(is_label_map(label_map(size, [](int x, int y, int z) { return ball(x, y, z, 9.5, 7); })));
    EXPECT_TRUE(is_label_map(label_map(size, [](int x, int y, int) { return x / 7 + 3 * (y / 7); })));
    EXPECT_FALSE(is_label_map(label_map(size, [](int, int, int) { return 0; })));
    EXPECT_FALSE(is_label_map(map_from_values(size, noise(8000, 1))));
    std::vector<float> counts = noise(8000, 1);
    for (float& v : counts) v = std::round(100 * v);
    EXPECT_FALSE(is_label_map(map_from_values(size, counts)));
    counts.assign(8000, 1);
    counts[77] = std::nanf("");
    EXPECT_FALSE(is_label_map(map_from_values(size, counts)));
}

TEST(LabelSurfaces, ARealVesicleLosesItsStaircase) {
    VDBGEO_NEEDS_DATA("pycurv/t74_vesicle3_bin6.Labels.mrc");
    const DensityMap map = read_map(data_folder() / "pycurv/t74_vesicle3_bin6.Labels.mrc").map;
    EXPECT_TRUE(is_label_map(map));
    const auto raw = label_surfaces(map, rounds(0)), out = label_surfaces(map);
    ASSERT_EQ(out.size(), 1u);
    EXPECT_EQ(expect_closed_manifold(out[0].mesh).components, 1u);
    EXPECT_LT(mean_fold(out[0].mesh), mean_fold(raw[0].mesh) / 3);
}

TEST(LabelSurfaces, ARealSegmentationOfManyLabels) {
    VDBGEO_NEEDS_DATA("pyto/labels.mrc");
    const DensityMap map = read_map(data_folder() / "pyto/labels.mrc").map;
    EXPECT_TRUE(is_label_map(map));
    const auto out = label_surfaces(map);
    EXPECT_EQ(out.size(), 15u);
    for (const LabelSurface& s : out) expect_closed_manifold(s.mesh);
}
