// Marching cubes against the trilinear interpolant's topology, cell by cell and over whole fields. The
// oracle (trilinear_oracle.h) shares nothing with the code under test.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "tests/support/maps.h"
#include "tests/support/trilinear_oracle.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/marching_cubes.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

using Corners = std::array<float, 8>;
using Random = std::mt19937_64;

double uniform(Random& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }
/// e^−range … e^range, evenly in the exponent: ambiguous faces go both ways.
double magnitude(Random& random, double range) { return std::exp(range * (2 * uniform(random) - 1)); }
double gaussian(Random& random) {
    return std::sqrt(-2 * std::log(1 - uniform(random))) * std::cos(2 * M_PI * uniform(random));
}

Box<3> box_of(const Corners& values) {
    Box<3> box;
    std::copy(values.begin(), values.end(), box.value.begin());
    return box;
}

int sign_case(const Corners& values) {
    int bits = 0;
    for (int c = 0; c < 8; ++c) bits |= (values[static_cast<std::size_t>(c)] >= 0) << c;
    return bits;
}

std::string text(const Corners& values) {
    std::string s = "corners (x fastest):";
    for (const float v : values) s += " " + ::testing::PrintToString(v);
    return s;
}

/// The smallest of the sign cases that rotations, reflections and an exchange of inside and outside make of
/// one: 15 classes at most (Lorensen & Cline's, mirror images counted once).
int class_of(int sign_case) {
    int smallest = 255;
    int order[3] = {0, 1, 2};
    do
        for (int flip = 0; flip < 8; ++flip) {
            int image = 0;
            for (int c = 0; c < 8; ++c) {
                int to = 0;
                for (int a = 0; a < 3; ++a) to |= (c >> a & 1) << order[a];
                image |= (sign_case >> c & 1) << (to ^ flip);
            }
            smallest = std::min({smallest, image, 255 - image});
        }
    while (std::next_permutation(order, order + 3));
    return smallest;
}

/// Values of f at the saddles of its restrictions to the six faces.
std::vector<double> face_saddles(const Box<3>& f) {
    std::vector<double> out;
    for (int a = 0; a < 3; ++a)
        for (int place = 0; place < 2; ++place) {
            const Box<2> q = f.side(a, place);
            const double twist = q.at(0) + q.at(3) - q.at(1) - q.at(2);
            if (twist != 0) out.push_back((q.at(0) * q.at(3) - q.at(1) * q.at(2)) / twist);
        }
    return out;
}

/// Values of f at its critical points inside the cell. With the origin moved to where the mixed terms vanish
/// f = h·xyz + px + qy + rz + s; there ∇f = 0 gives h·xyz = −px = −qy = −rz and (h·xyz)² = −pqr/h.
std::vector<double> body_saddles(const Box<3>& box) {
    double k[8];  // coefficient of the product of the coordinates whose bits are set
    for (int c = 0; c < 8; ++c) k[c] = box.at(c);
    for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 8; ++c)
            if (c >> a & 1) k[c] -= k[c ^ 1 << a];
    const double h = k[7], p = k[1] - k[3] * k[5] / h, q = k[2] - k[3] * k[6] / h, r = k[4] - k[5] * k[6] / h;
    const double origin[3] = {-k[6] / h, -k[5] / h, -k[3] / h};
    const double square = -p * q * r / h;
    std::vector<double> out;
    if (!(square > 0)) return out;
    for (const double m : {std::sqrt(square), -std::sqrt(square)}) {
        const double at[3] = {origin[0] - m / p, origin[1] - m / q, origin[2] - m / r};
        if (*std::min_element(at, at + 3) <= 0 || *std::max_element(at, at + 3) >= 1) continue;
        double f = 0;
        for (int c = 0; c < 8; ++c) {
            double term = k[c];
            for (int a = 0; a < 3; ++a) term *= (c >> a & 1) ? at[a] : 1;
            f += term;
        }
        out.push_back(f);
    }
    return out;
}

/// The surface of one cell in the oracle's terms, from the triangles.
struct MeshedCell {
    Pieces<3> surface;
    std::array<int, 12> loop;
    std::string defect;
};

/// Which of a 2×2×2 map's twelve edges a vertex lies on; nothing for a vertex inside the cell.
std::optional<int> edge_of(const Vec3f& p) {
    std::optional<int> edge;
    int between = 0;
    for (int a = 0; a < 3; ++a) {
        if (p[a] > 0 && p[a] < 1) ++between;
        if (p[a] == 0 || p[a] == 1) continue;
        const int c = (p[(a + 1) % 3] == 1) << (a + 1) % 3 | (p[(a + 2) % 3] == 1) << (a + 2) % 3;
        edge = 4 * a + Box<3>::remove(c, a);
    }
    return between == 1 ? edge : std::nullopt;
}

/// Smallest edge number in each set of vertices, by vertex on an edge.
template <class Sets>
std::array<int, 12> smallest_edges(const std::vector<std::optional<int>>& edge, Sets& sets) {
    std::map<std::size_t, int> smallest;
    for (std::size_t v = 0; v < edge.size(); ++v)
        if (edge[v]) {
            const auto [it, fresh] = smallest.emplace(sets.root(v), *edge[v]);
            if (!fresh) it->second = std::min(it->second, *edge[v]);
        }
    std::array<int, 12> out;
    out.fill(-1);
    for (std::size_t v = 0; v < edge.size(); ++v)
        if (edge[v]) out[static_cast<std::size_t>(*edge[v])] = smallest[sets.root(v)];
    return out;
}

MeshedCell describe(const TriMesh& mesh) {
    MeshedCell out;
    out.loop.fill(-1);
    const std::size_t n = mesh.points.size();
    std::vector<std::optional<int>> edge;
    for (const Vec3f& p : mesh.points) {
        edge.push_back(edge_of(p));
        if (!edge.back() && (p.minCoeff() <= 0 || p.maxCoeff() >= 1)) out.defect = "vertex not inside";
    }
    constexpr std::size_t most = 12 + 6;
    if (n > most) return out.defect = "too many vertices", out;
    SmallSets<most> pieces({}), loops({});
    std::array<std::array<int, most>, most> runs{};  // how often triangles run from one vertex to another
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            pieces.join(t[k], t[(k + 1) % 3]);
            ++runs[t[k]][t[(k + 1) % 3]];
        }
    int edges = 0;
    std::array<int, most> ends{};
    for (std::size_t a = 0; a < n; ++a)
        for (std::size_t b = 0; b < a; ++b) {
            if (runs[a][b] > 1 || runs[b][a] > 1) out.defect = "an edge run through twice in one direction";
            edges += runs[a][b] + runs[b][a] > 0;
            if (runs[a][b] + runs[b][a] != 1) continue;
            loops.join(a, b);
            ++ends[a];
            ++ends[b];
        }
    for (std::size_t v = 0; v < n; ++v)
        if (ends[v] != (edge[v] ? 2 : 0)) out.defect = "a boundary that is not a simple curve";
    out.surface.piece = smallest_edges(edge, pieces);
    out.loop = smallest_edges(edge, loops);
    out.surface.euler = static_cast<int>(n) - edges + static_cast<int>(mesh.triangles.size());
    return out;
}

/// Meshes single cells and compares them with the oracle.
class CellComparison {
 public:
    CellComparison() {
        map_.grid = openvdb::FloatGrid::create(0.0f);
        map_.frame.size = Vec3i(2, 2, 2);
    }

    /// The cell's surface by the oracle; nothing where undecided.
    std::optional<CellSurface> compare(const Corners& values) {
        ++samples;
        const auto expected = cell_surface(box_of(values));
        if (!expected) {
            ++undecided;
            return expected;
        }
        for (int c = 0; c < 8; ++c)
            map_.grid->tree().setValue(openvdb::Coord(c & 1, c >> 1 & 1, c >> 2 & 1),
                                       values[static_cast<std::size_t>(c)]);
        const MeshedCell meshed = describe(marching_cubes(map_, {0.0}));
        EXPECT_EQ(meshed.defect, "") << text(values);
        EXPECT_EQ(meshed.loop, expected->loop) << text(values);
        EXPECT_EQ(meshed.surface.piece, expected->surface.piece) << text(values);
        EXPECT_EQ(meshed.surface.euler, expected->surface.euler) << text(values);
        if (expected->surface.euler < expected->surface.count()) ++tunnels[class_of(sign_case(values))];
        return expected;
    }

    int samples = 0, undecided = 0;
    std::map<int, int> tunnels;  // by class of the sign case

 private:
    DensityMap map_;
};

/// The classes in which a piece can be a tube, by one member of each: Chernyaev's 4, 6, 7, 10, 12 and 13.
std::set<int> classes_with_tunnels() {
    const auto bits = [](std::initializer_list<int> corners) {
        int b = 0;
        for (const int c : corners) b |= 1 << c;
        return class_of(b);
    };
    return {bits({0, 7}),       bits({0, 1, 7}),    bits({0, 3, 5}),
            bits({0, 1, 6, 7}), bits({0, 1, 2, 7}), bits({0, 3, 5, 6})};
}

void expect_tunnels(const CellComparison& cells, int at_least) {
    std::set<int> seen;
    for (const auto& [sign_class, count] : cells.tunnels) {
        seen.insert(sign_class);
        EXPECT_GE(count, at_least) << "class " << sign_class;
    }
    EXPECT_EQ(seen, classes_with_tunnels());
}

}  // namespace

TEST(Topology, ClassesOfSignCases) {
    std::set<int> classes;
    for (int i = 0; i < 256; ++i) classes.insert(class_of(i));
    EXPECT_EQ(classes.size(), 14u);  // 15 with the two mirror images of one told apart
    EXPECT_EQ(classes_with_tunnels().size(), 6u);
}

namespace {

/// χ of the level set from the samples of a fine grid. The surface is where inside and outside meet and their
/// union is the cell, so χ(inside) + χ(outside) − χ(surface) = 1; a side's χ is that of all the grid's
/// vertices, edges, squares and cubes that have no corner on the other side.
int euler_by_dense_sampling(const Box<3>& box, int n) {
    std::vector<int> cube(static_cast<std::size_t>((n + 1) * (n + 1) * (n + 1)));
    const auto number = [n](int x, int y, int z) {
        return static_cast<std::size_t>((z * (n + 1) + y) * (n + 1) + x);
    };
    for (int z = 0; z <= n; ++z)
        for (int y = 0; y <= n; ++y)
            for (int x = 0; x <= n; ++x) {
                const double t[3] = {double(x) / n, double(y) / n, double(z) / n};
                double f = 0;
                for (int c = 0; c < 8; ++c) {
                    double weight = box.at(c);
                    for (int a = 0; a < 3; ++a) weight *= (c >> a & 1) ? t[a] : 1 - t[a];
                    f += weight;
                }
                cube[number(x, y, z)] = f >= 0;
            }
    int euler = -1;
    for (int z = 0; z <= n; ++z)
        for (int y = 0; y <= n; ++y)
            for (int x = 0; x <= n; ++x)
                for (int span = 0; span < 8; ++span) {  // the element from here along the axes in `span`
                    if (x + (span & 1) > n || y + (span >> 1 & 1) > n || z + (span >> 2 & 1) > n) continue;
                    bool same = true;
                    for (int c = span; c; c = (c - 1) & span)
                        same = same && cube[number(x, y, z)] ==
                                           cube[number(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2 & 1))];
                    if (same) euler += span == 1 || span == 2 || span == 4 || span == 7 ? -1 : 1;
                }
    return euler;
}

}  // namespace

TEST(Topology, TheOracleAgreesWithDenseSampling) {
    Random random(11);
    int compared = 0, tunnels = 0;
    while (compared < 150 || tunnels < 20) {
        Box<3> box;
        const int signs[] = {static_cast<int>(random() % 256), 0x69, 0x41 | 0x80, 0xC3};
        for (std::size_t c = 0; c < 8; ++c)
            box.value[c] = (signs[random() % 4] >> c & 1 ? 1 : -1) * magnitude(random, 1);
        // Where the level is near a saddle the surface has necks too thin for the grid.
        std::vector<double> saddles = face_saddles(box);
        for (const double s : body_saddles(box)) saddles.push_back(s);
        if (std::any_of(saddles.begin(), saddles.end(), [](double s) { return std::abs(s) < 0.06; }))
            continue;
        const auto surface = level_set(box);
        ASSERT_TRUE(surface);
        const bool tunnel = surface->euler < surface->count();
        if (!tunnel && compared >= 150) continue;
        ++compared;
        tunnels += tunnel;
        EXPECT_EQ(surface->euler, euler_by_dense_sampling(box, 40));
    }
}

TEST(Topology, EverySignCaseWithRandomMagnitudes) {
    Random random(1);
    CellComparison cells;
    for (int signs = 0; signs < 256; ++signs)
        for (int i = 0; i < 240; ++i) {
            const double range[] = {0.3, 1, 3};
            Corners values;
            for (std::size_t c = 0; c < 8; ++c) {
                const double m = i % 4 == 3 ? uniform(random) + 1e-6 : magnitude(random, range[i % 4]);
                values[c] = static_cast<float>(signs >> c & 1 ? m : -m);
            }
            cells.compare(values);
            if (HasFailure()) return;
        }
    EXPECT_LT(cells.undecided, cells.samples / 10000);
    expect_tunnels(cells, 5);
}

// The checkerboard (case 13) has six ambiguous faces, but not all 64 ways to resolve them exist: with p the
// logarithms of the inside corners and q of the outside ones, a face joins its inside corners where
// Σp − Σq > 0 over its own corners; for every pair of opposite faces the two sums add up to the same total
// over the cell. So no pair can be joined both ways if another is parted both ways: 3³ + 3³ − 2³ = 46.
TEST(Topology, TheCheckerboardInAllItsResolutions) {
    Random random(2);
    CellComparison cells;
    std::map<int, int> resolutions;
    for (int i = 0; i < 40000; ++i) {
        Corners values;
        const double bias = (i % 3 - 1) * 0.5;  // towards all joined and all parted
        for (std::size_t c = 0; c < 8; ++c) {
            const bool inside = 0x69 >> c & 1;
            const double m = magnitude(random, i % 2 ? 1 : 2.5) * std::exp(inside ? bias : -bias);
            values[c] = static_cast<float>(inside ? m : -m);
        }
        if (!cells.compare(values)) continue;
        const Box<3> box = box_of(values);
        int joined = 0;
        for (int f = 0; f < 6; ++f) {
            const auto arcs = level_set(box.side(f / 2, f % 2));
            ASSERT_TRUE(arcs && arcs->count() == 2);
            // Edges 0 and 2 end at the face's corner 0. If they are one arc, corner 0 is cut off from
            // corner 3.
            const bool corner_0_alone = arcs->piece[2] == 0,
                       corner_0_inside = box.side(f / 2, f % 2).inside(0);
            joined |= (corner_0_alone != corner_0_inside) << f;
        }
        ++resolutions[joined];
        if (HasFailure()) return;
    }
    EXPECT_EQ(resolutions.size(), 46u);
    for (const auto& [faces, count] : resolutions) EXPECT_GE(count, 5) << "faces " << faces;
    EXPECT_GE(cells.tunnels[class_of(0x69)], 50);
    EXPECT_LT(cells.undecided, 3);
}

namespace {

/// Compares cells whose level is within a relative 1e-2 … 1e-6 of a saddle, on both sides of it.
void compare_beside_saddles(CellComparison& cells, Random& random,
                            std::vector<double> (*saddles)(const Box<3>&), int count) {
    while (cells.samples < count) {
        Box<3> box;
        for (double& v : box.value) v = (random() % 2 ? 1 : -1) * magnitude(random, 1);
        for (const double saddle : saddles(box))
            for (const int way : {-1, 1}) {
                const double gap = way * std::pow(10, -2 - 4 * uniform(random));
                Corners values;
                for (std::size_t c = 0; c < 8; ++c)
                    values[c] = static_cast<float>(box.value[c] - saddle + gap);
                cells.compare(values);
            }
        if (testing::Test::HasFailure()) return;
    }
    EXPECT_LT(cells.undecided, cells.samples / 1000);
}

}  // namespace

TEST(Topology, LevelsBesideTheSaddlesOfFaces) {
    Random random(3);
    CellComparison cells;
    compare_beside_saddles(cells, random, face_saddles, 12000);
}

TEST(Topology, LevelsBesideTheSaddlesInside) {
    Random random(4);
    CellComparison cells;
    compare_beside_saddles(cells, random, body_saddles, 12000);
    expect_tunnels(cells, 10);
}

// Values with symmetries: all magnitudes equal but for a few, which random magnitudes never give. Many lie on
// a saddle and are undecided; the rest must agree.
TEST(Topology, SmallIntegersAtTheCorners) {
    Random random(5);
    CellComparison cells;
    for (int i = 0; i < 30000; ++i) {
        Corners values;
        for (float& v : values)
            v = static_cast<float>((random() % 2 ? 1 : -1) * static_cast<int>(1 + random() % 3));
        cells.compare(values);
        if (HasFailure()) return;
    }
    EXPECT_GT(cells.samples - cells.undecided, 5000);
}

namespace {

std::vector<float> gaussian_noise(std::size_t count, std::uint64_t seed) {
    Random random(seed);
    std::vector<float> values(count);
    for (float& v : values) v = static_cast<float>(gaussian(random));
    return values;
}

std::vector<float> rounded(std::vector<float> values, float step) {
    for (float& v : values) v = step * std::round(v / step);
    return values;
}

std::size_t cube(int n) { return static_cast<std::size_t>(n) * static_cast<std::size_t>(n * n); }

TriMesh extract(int n, const std::vector<float>& values) {
    return marching_cubes(map_from_values(Vec3i(n, n, n), values), {0.0});
}

/// Two faces at every edge, but for edges in a face of the box; and each of those is the boundary.
void expect_manifold_inside(const TriMesh& mesh, const Vec3i& size) {
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.non_manifold_edges, 0u);
    EXPECT_EQ(m.misoriented_edges, 0u);
    EXPECT_EQ(m.non_manifold_vertices, 0u);
    EXPECT_EQ(m.degenerate_faces, 0u);
    EXPECT_EQ(m.unused_vertices, 0u);
    std::uint64_t in_border = 0;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3f p = mesh.points[t[k]], q = mesh.points[t[(k + 1) % 3]];
            bool common = false;
            for (int a = 0; a < 3; ++a)
                for (const float border : {0.0f, static_cast<float>(size[a] - 1)})
                    common = common || (p[a] == border && q[a] == border);
            in_border += common;
        }
    std::vector<std::array<float, 3>> points;
    for (const Vec3f& p : mesh.points) points.push_back({p.x(), p.y(), p.z()});
    std::sort(points.begin(), points.end());
    EXPECT_TRUE(std::adjacent_find(points.begin(), points.end()) == points.end()) << "coincident vertices";
    // As many as there are; an edge with one face inside, or one with two in the border, would tell.
    EXPECT_EQ(m.boundary_edges, in_border);
}

void expect_the_interpolants_topology(int n, const std::vector<float>& values) {
    const TriMesh mesh = extract(n, values);
    expect_manifold_inside(mesh, Vec3i(n, n, n));
    const FieldSurface expected = field_surface(Vec3i(n, n, n), values);
    EXPECT_EQ(expected.undecided_cells, 0);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.euler_characteristic, expected.euler);
    EXPECT_EQ(static_cast<std::int64_t>(m.components), expected.components);
}

}  // namespace

TEST(Topology, NoiseHasTheInterpolantsEulerCharacteristicAndComponents) {
    const int n = 64;
    expect_the_interpolants_topology(n, noise(cube(n), 21));
    expect_the_interpolants_topology(n, gaussian_noise(cube(n), 22));
}

TEST(Topology, ManySmallFieldsOfNoise) {
    for (std::uint64_t seed = 100; seed < 140; ++seed) {
        expect_the_interpolants_topology(16,
                                         seed % 2 ? noise(cube(16), seed) : gaussian_noise(cube(16), seed));
        ASSERT_FALSE(HasFailure()) << "seed " << seed;
    }
}

TEST(Topology, RoundedNoiseIsManifoldThoughSamplesLieAtTheIsovalue) {
    const int n = 64;
    for (const float step : {1.0f, 0.5f})
        for (const auto& values :
             {rounded(gaussian_noise(cube(n), 23), step), rounded(noise(cube(n), 24), step)})
            expect_manifold_inside(extract(n, values), Vec3i(n, n, n));
}

TEST(Topology, NoiseGivesTheSameBytesForAnyNumberOfThreads) {
    const int n = 64;
    for (const auto& values : {noise(cube(n), 25), rounded(gaussian_noise(cube(n), 26), 1)}) {
        const auto bytes = [&](std::size_t threads) {
            tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
            const TriMesh mesh = extract(n, values);
            const auto* points = reinterpret_cast<const char*>(mesh.points.data());
            const auto* triangles = reinterpret_cast<const char*>(mesh.triangles.data());
            return std::string(points, mesh.points.size() * sizeof(Vec3f)) +
                   std::string(triangles, mesh.triangles.size() * sizeof(Triangle));
        };
        const std::string one = bytes(1);
        EXPECT_GT(one.size(), 1000000u);
        EXPECT_TRUE(one == bytes(2));
        EXPECT_TRUE(one == bytes(7));
    }
}
