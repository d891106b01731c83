#include "vdbgeo/tet/tetgen_tetrahedra.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/filled_mesh.h"
#include "vdbgeo/tet/isolated.h"
#include "vdbgeo/tet/solid_input.h"

#ifdef VDBGEO_HAS_TETGEN
// TetGen ends by an inline function that frees the mesh and throws a number; on the way out a destructor
// frees it again. The one below takes its place, in the library too: a weak symbol there.
class tetgenmesh;
__attribute__((visibility("default"), noinline)) void terminatetetgen(tetgenmesh*, int code);
#define terminatetetgen terminatetetgen_of_the_header
#include <tetgen.h>
#undef terminatetetgen

void terminatetetgen(tetgenmesh*, int code) { throw code; }
#endif

namespace vdbgeo {
namespace {

constexpr const char* stage = "tetgen";

void require_range(const char* name, double value, double low, double high) {
    if (!(value >= low && value <= high))
        throw InvalidInput(
            fmt::format("{}: the {} is {}, where {} to {} is needed", stage, name, value, low, high));
}

}  // namespace

void TetgenOptions::check() const {
    require_range("largest ratio of circumradius to edge", radius_edge, 1, 100);
    require_range("least dihedral angle", min_dihedral_deg, 0, 18);
    if (max_volume_A3 && !(*max_volume_A3 > 0 && std::isfinite(*max_volume_A3)))
        throw InvalidInput(fmt::format("{}: the largest volume is {} Å³, where more than 0 is needed", stage,
                                       *max_volume_A3));
    if (max_tets == 0) throw InvalidInput("tetgen: no tetrahedra are allowed");
    if (!(max_seconds > 0))
        throw InvalidInput(fmt::format("tetgen: {} s are allowed, where more than 0 is needed", max_seconds));
}

#ifndef VDBGEO_HAS_TETGEN

bool have_tetgen() { return false; }

TetMesh tetgen_tetrahedra(const TriMesh&, const TetgenOptions&, const Progress&) {
    throw InvalidInput("tetgen: this build has no TetGen");
}

#else

namespace {

/// Of a tetrahedron with the volume κ·h³ for edges of length h. Refinement until no tetrahedron is larger
/// leaves edges of about that length on average; the regular tetrahedron has κ = 0.118.
constexpr double volume_of_size = 0.2;

/// TetGen asks a plain function; there is one process for one mesh.
const SizeField* wanted_size = nullptr;

bool is_too_large(double* pa, double* pb, double* pc, double* pd, double*, double) {
    const Eigen::Map<const Vec3d> a(pa), b(pb), c(pc), d(pd);
    const Vec3d centre = (a + b + c + d) / 4;
    const double size = (*wanted_size)(centre);
    if (!(size > 0))
        throw InvalidInput(fmt::format("the size of edges wanted at {:.6g}, {:.6g}, {:.6g} is {}", centre.x(),
                                       centre.y(), centre.z(), size));
    return std::abs(tet_determinant(a, b, c, d)) > 6 * volume_of_size * size * size * size;
}

/// What lives until the process ends: nothing of it is ever freed.
struct Plc {
    tetgenio io;
    std::vector<tetgenio::polygon> polygons;
    Array<Triangle> corners;
};

/// The surface, a seed for each solid with its place as the attribute, and the holes.
void fill_plc(const SolidInput& input, Plc& plc) {
    tetgenio& io = plc.io;
    io.firstnumber = 0;
    io.numberofpoints = static_cast<int>(input.points.size());
    io.pointlist = new double[3 * input.points.size()];
    for (std::size_t i = 0; i < input.points.size(); ++i)
        Eigen::Map<Vec3d>(io.pointlist + 3 * i) = input.points[i];
    plc.corners = input.triangles;
    plc.polygons.resize(input.triangles.size());
    io.numberoffacets = static_cast<int>(input.triangles.size());
    io.facetlist = new tetgenio::facet[input.triangles.size()];
    for (std::size_t f = 0; f < input.triangles.size(); ++f) {
        plc.polygons[f] = {reinterpret_cast<int*>(plc.corners[f].data()), 3};
        io.facetlist[f] = {&plc.polygons[f], 1, nullptr, 0};
    }
    io.numberofregions = static_cast<int>(input.regions.size());
    io.regionlist = new double[5 * input.regions.size()];
    for (std::size_t r = 0; r < input.regions.size(); ++r) {
        double* region = io.regionlist + 5 * r;
        Eigen::Map<Vec3d>{region} = input.regions[r].inside;
        region[3] = static_cast<double>(r + 1);
        region[4] = -1;
    }
    io.numberofholes = static_cast<int>(input.holes.size());
    io.holelist = new double[3 * input.holes.size()];
    for (std::size_t h = 0; h < input.holes.size(); ++h)
        Eigen::Map<Vec3d>(io.holelist + 3 * h) = input.holes[h];
}

int steiner_points_allowed(const TetgenOptions& options) {
    // New points have some six tetrahedra each.
    return static_cast<int>(std::min<std::uint64_t>(options.max_tets / 5 + 1000, 400'000'000));
}

tetgenbehavior switches(const TetgenOptions& options) {
    // Triangles that lie in a plane to a tenth of a degree are one facet for TetGen, which may swap their
    // edges; M keeps them apart. Where the surface may change that is not wanted: TetGen protects all edges
    // of facets, by many small tetrahedra where they meet at acute angles.
    std::string text =
        fmt::format("pqAQS{}{}", steiner_points_allowed(options), options.keep_surface ? "MY" : "");
    if (options.max_volume_A3) text += "a1";
    tetgenbehavior behavior;
    if (!behavior.parse_commandline(text.data())) throw NumericalError("it does not understand its switches");
    behavior.minratio = options.radius_edge;
    behavior.mindihedral = options.min_dihedral_deg;
    if (options.max_volume_A3) behavior.maxvolume = *options.max_volume_A3;
    return behavior;
}

[[noreturn]] void throw_code(int code) {
    switch (code) {
        case 1:
            throw std::bad_alloc();
        case 3:
            throw InvalidInput("faces of the surface cut each other; try repair or remesh");
        case 4:
            throw NumericalError("the surface has features that are too small for it; try remesh first");
        case 5:
            throw NumericalError("two faces are too close to each other; try repair or remesh first");
        case 10:
            throw InvalidInput("it does not take this surface; try repair");
        default:
            throw NumericalError(
                fmt::format("it failed (code {}); try remesh first, or another method", code));
    }
}

void check_caps(const tetgenio& out, std::size_t points, const TetgenOptions& options) {
    const auto tets = static_cast<std::uint64_t>(out.numberoftetrahedra);
    const auto added = out.numberofpoints - static_cast<int>(points);
    if (tets > options.max_tets || added >= steiner_points_allowed(options))
        throw NumericalError(fmt::format("more than {} tetrahedra, the limit", options.max_tets));
}

/// Without the tetrahedra of spaces that nobody asked for.
Filling filling_of(const tetgenio& out, std::size_t solids) {
    Filling filling;
    filling.points.resize(static_cast<std::size_t>(out.numberofpoints));
    for (std::size_t i = 0; i < filling.points.size(); ++i)
        filling.points[i] = Eigen::Map<const Vec3d>(out.pointlist + 3 * i);
    const auto stride = static_cast<std::size_t>(out.numberoftetrahedronattributes);
    if (stride == 0 && out.numberoftetrahedra > 0) throw NumericalError("it did not tell the regions");
    for (std::size_t t = 0; t < static_cast<std::size_t>(out.numberoftetrahedra); ++t) {
        const double attribute = out.tetrahedronattributelist[t * stride];
        if (!(attribute >= 1 && attribute <= double(solids))) continue;
        const int* c = out.tetrahedronlist + 4 * t;
        filling.tets.push_back({VertexId(c[0]), VertexId(c[1]), VertexId(c[2]), VertexId(c[3])});
        filling.solid.push_back(static_cast<std::int32_t>(attribute) - 1);
    }
    return filling;
}

/// In a process of its own.
std::vector<std::byte> run_tetgen(const SolidInput& input, const TetgenOptions& options) {
    auto* plc = new Plc;
    auto* out = new tetgenio;
    fill_plc(input, *plc);
    if (options.size) {
        wanted_size = &options.size;
        plc->io.tetunsuitable = &is_too_large;
    }
    tetgenbehavior behavior = switches(options);
    try {
        tetrahedralize(&behavior, &plc->io, out);
    } catch (const int code) {
        throw_code(code);
    }
    check_caps(*out, input.points.size(), options);
    return to_bytes(filling_of(*out, input.regions.size()));
}

}  // namespace

bool have_tetgen() { return true; }

TetMesh tetgen_tetrahedra(const TriMesh& surface, const TetgenOptions& options, const Progress& progress) {
    options.check();
    const SolidInput input = solid_input(surface, stage, progress.part(0, 0.1));
    constexpr std::size_t most = 1u << 29;  // TetGen counts in 32 bits
    if (input.triangles.size() > most || input.triangles.size() > options.max_tets)
        throw InvalidInput(fmt::format("{}: the surface has {} faces, more than the {} tetrahedra allowed",
                                       stage, input.triangles.size(),
                                       std::min<std::uint64_t>(most, options.max_tets)));
    const IsolationLimits limits{options.max_seconds, options.max_bytes};
    const std::vector<std::byte> bytes =
        run_isolated([&] { return run_tetgen(input, options); }, limits, stage, progress.part(0.1, 0.9));
    TetMesh mesh = filled_mesh(filling_from_bytes(bytes, stage), input, options.keep_surface, stage);
    progress.report(1);
    return mesh;
}

#endif

}  // namespace vdbgeo
