#include "apps/tet_flags.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "apps/flags.h"

namespace vdbgeo::app {
namespace {

/// The flags that not every method has.
struct Owned {
    const char* flag;
    std::vector<std::string> methods;
};

const std::vector<Owned>& owned_flags() {
    static const std::vector<std::string> bounded{"cgal", "tetgen", "netgen"};
    static const std::vector<Owned> table{{"--cell", {"stuffing"}},
                                          {"--coarsening", {"stuffing"}},
                                          {"--angle", bounded},
                                          {"--radius", bounded},
                                          {"--distance", bounded},
                                          {"--radius-edge", {"cgal", "tetgen"}},
                                          {"--cell-size", {"cgal"}},
                                          {"--lloyd", {"cgal"}},
                                          {"--odt", {"cgal"}},
                                          {"--perturb", {"cgal"}},
                                          {"--exude", {"cgal"}},
                                          {"--sliver-bound", {"cgal"}},
                                          {"--parallel", {"cgal"}},
                                          {"--size-by", {"cgal", "tetgen"}},
                                          {"--size-range", {"cgal", "tetgen"}},
                                          {"--min-dihedral", {"tetgen"}},
                                          {"--max-volume", {"tetgen"}},
                                          {"--split-surface", {"tetgen"}},
                                          {"--max-edge", {"netgen"}},
                                          {"--grading", {"netgen"}},
                                          {"--rounds", {"netgen"}}};
    return table;
}

bool owns(const Owned& row, const std::string& method) {
    return std::find(row.methods.begin(), row.methods.end(), method) != row.methods.end();
}

void parse(const char* flag, LengthFlag& length) {
    length.in_A = parse_length(flag, "voxels or mean edges", length.text, length.value);
}

/// "LOW:HIGH", two numbers above 0.
void parse_range(const char* flag, const std::string& text, double& low, double& high) {
    const char *at = text.data(), *end = at + text.size();
    const auto first = std::from_chars(at, end, low);
    const bool colon = first.ec == std::errc() && first.ptr != end && *first.ptr == ':';
    const auto second = colon ? std::from_chars(first.ptr + 1, end, high) : first;
    if (!colon || second.ec != std::errc() || second.ptr != end || !(low > 0) || !(high >= low) ||
        !std::isfinite(high))
        throw UsageError(fmt::format("{}: '{}' is not LOW:HIGH, two numbers above 0", flag, text));
}

}  // namespace

const std::vector<std::string>& tet_methods() {
    static const std::vector<std::string> methods{"stuffing", "cgal", "tetgen", "netgen"};
    return methods;
}

void TetFlags::add(CLI::App& app) {
    const auto length = [&app](const char* flag, LengthFlag& to, const std::string& text) {
        app.add_option(flag, to.text, text)->type_name("LENGTH");
    };
    app.add_option(
           "--method", method,
           "stuffing (isosurface stuffing: fast, proven angles), cgal (Delaunay refinement, straight "
           "from the map too), tetgen or netgen (fill a surface, whose triangles they keep) [stuffing "
           "for a map, cgal for --labels, tetgen for a mesh]")
        ->check(CLI::IsMember(tet_methods()).description(""));
    length(
        "--cell", cell_,
        fmt::format("stuffing: side of the cubes at the surface, in voxels (of a mesh: mean edges), or in Å "
                    "as 3A [{}; 1 of a mesh]",
                    stuffing_.cell));
    app.add_option("--coarsening", stuffing_.coarsening,
                   "stuffing: how many times cubes may double their side inside")
        ->capture_default_str();
    app.add_option("--angle", angle_,
                   fmt::format("cgal; tetgen and netgen of a map: least angle of a boundary triangle, in "
                               "degrees [{}; {}]",
                               delaunay_.facet_angle_deg, surface_.angle_deg));
    length(
        "--radius", radius_,
        fmt::format("cgal; tetgen and netgen of a map: largest radius of a boundary triangle's surface ball, "
                    "in voxels (of a mesh: mean edges), or in Å as 3A [{}; {}]",
                    delaunay_.facet_size, surface_.radius));
    length("--distance", distance_,
           fmt::format("cgal; tetgen and netgen of a map: largest distance of a boundary triangle from the "
                       "surface, in voxels (of a mesh: mean edges), or in Å as 1A [{}; {}]",
                       delaunay_.facet_distance, surface_.distance));
    app.add_option("--radius-edge", radius_edge_,
                   fmt::format("cgal, tetgen: largest circumradius over shortest edge, 0.612 is the regular "
                               "tetrahedron's [{}; {}]",
                               delaunay_.cell_radius_edge, tetgen_.radius_edge));
    length(
        "--cell-size", cell_size_,
        fmt::format("cgal: largest circumradius of a tetrahedron, in voxels (of a mesh: mean edges), or in Å "
                    "as 3A [{}]",
                    delaunay_.cell_size));
    app.add_flag("--lloyd", delaunay_.lloyd, "cgal: smooth all (Lloyd)");
    app.add_flag("--odt", delaunay_.odt, "cgal: smooth all (optimal Delaunay triangulation)");
    app.add_flag("--perturb", delaunay_.perturb, "cgal: move vertices of slivers");
    app.add_flag("--exude", delaunay_.exude, "cgal: remove slivers by weights");
    app.add_option(
        "--sliver-bound", sliver_bound_,
        fmt::format("cgal: dihedral angle that --perturb and --exude try to reach, in degrees [{}]",
                    delaunay_.sliver_bound_deg));
    app.add_flag("--parallel", delaunay_.parallel, "cgal: all threads; another mesh in each run");
    app.add_option("--min-dihedral", min_dihedral_,
                   fmt::format("tetgen: smallest dihedral angle asked for, in degrees, 0 to 18 [{}]",
                               tetgen_.min_dihedral_deg));
    app.add_option("--max-volume", max_volume_, "tetgen: largest volume of a tetrahedron, in Å³ [any]");
    app.add_flag("--split-surface", split_surface_, "tetgen: may put new points on the surface");
    length("--max-edge", max_edge_,
           "netgen: longest edge wanted, in voxels (of a mesh: mean edges), or in Å as 6A [any]");
    app.add_option("--grading", netgen_.grading, "netgen: 0 (even) to 1 (grows fast away from the surface)")
        ->capture_default_str();
    app.add_option("--rounds", netgen_.optimisation_rounds, "netgen: rounds of its optimisation")
        ->capture_default_str();
    app.add_option(
           "--size-by", size_by_,
           "cgal, tetgen: small tetrahedra where the surface is curved (curvature) or the map is dense "
           "(density)")
        ->check(CLI::IsMember({"curvature", "density"}).description(""));
    app.add_option("--size-range", size_range_, "cgal, tetgen: edges for --size-by, in Å as LOW:HIGH");
    app.add_flag("--optimize", optimize,
                 "Better angles by moving vertices and flipping faces and edges, whatever the method");
    app.add_option("--optimize-bounds", optimize_bounds,
                   "Dihedral angles that --optimize tries to keep, in degrees as LOW:HIGH")
        ->capture_default_str();
    app.add_option("--max-tets", max_tets_, "Give up beyond this many tetrahedra")->capture_default_str();
    app.add_option("--max-seconds", max_seconds_, "cgal, tetgen, netgen: give up after this time, in seconds")
        ->capture_default_str();
}

void TetFlags::refuse_others(const CLI::App& app, const std::string& chosen) const {
    for (const Owned& row : owned_flags())
        if (!owns(row, chosen))
            refuse_flags(
                app, {row.flag},
                fmt::format("belongs to --method {}, not to {}", fmt::join(row.methods, ", "), chosen));
}

void TetFlags::finish(const CLI::App& app) {
    parse("--cell", cell_);
    parse("--radius", radius_);
    parse("--distance", distance_);
    parse("--cell-size", cell_size_);
    parse("--max-edge", max_edge_);
    if (!optimize) refuse_flags(app, {"--optimize-bounds"}, "belongs to --optimize");
    parse_range("--optimize-bounds", optimize_bounds, optimize_.min_dihedral_deg, optimize_.max_dihedral_deg);
    if (size_by_.empty()) {
        refuse_flags(app, {"--size-range"}, "belongs to --size-by");
    } else {
        if (size_range_.empty()) throw UsageError("--size-by: needs --size-range LOW:HIGH, in Å");
        parse_range("--size-range", size_range_, size_low_, size_high_);
    }
    if (max_tets_ < 1) throw UsageError("--max-tets: 0 tetrahedra are no mesh");
    // What is out of range is told before any file is read.
    check_usage(stuffing(1));
    check_usage(delaunay(1));
    check_usage(tetgen());
    check_usage(netgen(1));
    check_usage(surface(1));
    check_usage(optimize_);
}

std::string TetFlags::method_for(TetSource source) const {
    const std::string chosen = !method.empty()               ? method
                               : source == TetSource::map    ? "stuffing"
                               : source == TetSource::labels ? "cgal"
                                                             : "tetgen";
    if (source == TetSource::labels && chosen == "stuffing")
        throw UsageError("--method stuffing: takes no --labels; use cgal, tetgen or netgen");
    const bool there = chosen == "cgal"     ? have_delaunay_tetrahedra()
                       : chosen == "tetgen" ? have_tetgen()
                       : chosen == "netgen" ? have_netgen()
                                            : true;
    if (!there)
        throw UsageError(fmt::format("--method {}: this build has no {}", chosen,
                                     chosen == "cgal"     ? "CGAL"
                                     : chosen == "tetgen" ? "TetGen"
                                                          : "NetGen"));
    if (source == TetSource::map && (chosen == "tetgen" || chosen == "netgen") && !have_delaunay())
        throw UsageError(fmt::format(
            "--method {}: the surface of a map needs CGAL, which this build has not; give a mesh", chosen));
    return chosen;
}

std::vector<std::string> TetFlags::words_of(const CLI::App& app, const std::string& of) const {
    static const std::vector<std::string> never{"--compare", "--json", "--quiet", "--threads"};
    std::vector<std::string> words;
    for (const CLI::Option* option : app.get_options()) {
        const std::string name = option->get_name();
        if (option->count() == 0 || name.rfind("--", 0) != 0) continue;
        if (std::find(never.begin(), never.end(), name) != never.end()) continue;
        const auto& table = owned_flags();
        const auto row =
            std::find_if(table.begin(), table.end(), [&](const Owned& o) { return o.flag == name; });
        if (row != table.end() && !owns(*row, of)) continue;
        words.push_back(name);
        if (option->get_items_expected_max() > 0)
            for (const std::string& value : option->results()) words.push_back(value);
    }
    return words;
}

StuffingOptions TetFlags::stuffing(double unit_A) const {
    StuffingOptions o = stuffing_;
    if (cell_.given()) o.cell = cell_.in_units(unit_A);
    o.max_tets = max_tets_;
    return o;
}

DelaunayTetrahedraOptions TetFlags::delaunay(double unit_A) const {
    DelaunayTetrahedraOptions o = delaunay_;
    if (angle_) o.facet_angle_deg = *angle_;
    if (radius_.given()) o.facet_size = radius_.in_units(unit_A);
    if (distance_.given()) o.facet_distance = distance_.in_units(unit_A);
    if (radius_edge_) o.cell_radius_edge = *radius_edge_;
    if (cell_size_.given()) o.cell_size = cell_size_.in_units(unit_A);
    if (sliver_bound_) o.sliver_bound_deg = *sliver_bound_;
    o.max_vertices = std::max<std::uint64_t>(4, max_tets_ / 5);  // five to six tetrahedra a vertex
    o.max_seconds = max_seconds_;
    return o;
}

TetgenOptions TetFlags::tetgen() const {
    TetgenOptions o = tetgen_;
    if (radius_edge_) o.radius_edge = *radius_edge_;
    if (min_dihedral_) o.min_dihedral_deg = *min_dihedral_;
    o.max_volume_A3 = max_volume_;
    o.keep_surface = !split_surface_;
    o.max_tets = max_tets_;
    o.max_seconds = max_seconds_;
    return o;
}

NetgenOptions TetFlags::netgen(double unit_A) const {
    NetgenOptions o = netgen_;
    if (max_edge_.given()) o.max_edge_A = max_edge_.in_angstrom(unit_A);
    o.max_tets = max_tets_;
    o.max_seconds = max_seconds_;
    return o;
}

DelaunaySurfaceOptions TetFlags::surface(double unit_A) const {
    DelaunaySurfaceOptions o = surface_;
    if (angle_) o.angle_deg = *angle_;
    if (radius_.given()) o.radius = radius_.in_units(unit_A);
    if (distance_.given()) o.distance = distance_.in_units(unit_A);
    o.max_seconds = max_seconds_;
    return o;
}

}  // namespace vdbgeo::app
