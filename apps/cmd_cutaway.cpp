// vdbgeo cutaway: looking inside a tetrahedral mesh.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "apps/command.h"
#include "apps/cutaway_picture.h"
#include "apps/flags.h"
#include "apps/stages.h"
#include "apps/tet_reports.h"
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "vdbgeo/tet/tet_quality.h"
#include "vdbgeo/view/png.h"

namespace vdbgeo::app {
namespace {

struct CutawayCommandOptions {
    std::string in, out, plane = "y", from, property = "min_dihedral_deg", histogram;
    double at = 0.5;
    bool clip = false, no_edges = false;
    std::optional<std::uint64_t> peel, seed_face;
    RenderOptions render;

    // What the texts mean, after finish().
    Vec3d normal = -Vec3d::UnitY();
    std::optional<double> offset_A;  ///< the plane is n·x = this
    std::optional<Vec3d> from_A;
    bool own_view = false;

    bool picture() const { return has_ending(out, ".png"); }
};

/// Three or four numbers with commas between.
std::vector<double> numbers_of(const std::string& flag, const std::string& text,
                               const std::string& expected) {
    std::vector<double> numbers;
    const char *at = text.data(), *end = at + text.size();
    for (;;) {
        double number = 0;
        const auto [rest, error] = std::from_chars(at, end, number);
        if (error != std::errc() || !std::isfinite(number) || (rest != end && *rest != ','))
            throw UsageError(fmt::format("{}: '{}' is not {}", flag, text, expected));
        numbers.push_back(number);
        if (rest == end) return numbers;
        at = rest + 1;
    }
}

/// The axes' planes take away what is before them in the views side, front and top.
void parse_plane(CutawayCommandOptions& o) {
    const std::string expected = "x, y, z, a normal NX,NY,NZ, or NX,NY,NZ,D with D in Å";
    o.normal = normal_across(o.plane);
    if (o.normal.isZero()) {
        const std::vector<double> n = numbers_of("--plane", o.plane, expected);
        if (n.size() != 3 && n.size() != 4)
            throw UsageError(fmt::format("--plane: '{}' is not {}", o.plane, expected));
        o.normal = Vec3d(n[0], n[1], n[2]);
        const double length = o.normal.stableNorm();
        if (!(length > 0)) throw UsageError(fmt::format("--plane: '{}' has no direction", o.plane));
        o.normal.stableNormalize();
        if (n.size() == 4) o.offset_A = n[3] / length;
    }
}

void finish(CutawayCommandOptions& o, const CLI::App& flags) {
    if (o.peel)
        refuse_flags(flags, {"--plane", "--at", "--clip"}, "belongs to a cut by a plane, not to --peel");
    else
        refuse_flags(flags, {"--seed-face", "--from"}, "belongs to --peel");
    if (o.seed_face) refuse_flags(flags, {"--from"}, "means nothing with --seed-face");
    parse_plane(o);
    if (o.offset_A) refuse_flags(flags, {"--at"}, "means nothing where --plane has its place, NX,NY,NZ,D");
    if (!(o.at >= 0 && o.at <= 1)) throw UsageError("--at: expected a part of the way, 0 to 1");
    if (!o.from.empty()) {
        const std::string expected = "x,y,z in Å";
        const std::vector<double> p = numbers_of("--from", o.from, expected);
        if (p.size() != 3) throw UsageError(fmt::format("--from: '{}' is not {}", o.from, expected));
        o.from_A = Vec3d(p[0], p[1], p[2]);
    }
    if (!o.picture())
        refuse_flags(flags,
                     {"--property", "--no-edges", "--width", "--height", "--view", "--min", "--max",
                      "--samples", "--occlusion", "--title"},
                     "belongs to a picture: OUT.png");
    if (!o.picture() && !is_mesh_ending(o.out))
        throw UsageError(
            fmt::format("{}: the ending tells the format: .png or {}", o.out, mesh_endings_text()));
    check_plot_output(o.histogram);
    o.own_view = flags.get_option("--view")->count() > 0;
    check_usage(o.render);
}

/// The plane or peel in numbers; a plane's place along its normal is told as a part of the mesh's extent.
CutawayOptions cutaway_options(const CutawayCommandOptions& o, const TetMesh& mesh) {
    CutawayOptions options;
    if (o.peel) {
        Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (const Tetrahedron& t : mesh.tets)
            for (const VertexId v : t) {
                low = low.cwiseMin(mesh.points[v]), high = high.cwiseMax(mesh.points[v]);
            }
        // From before the mesh, as the view "front" has it.
        const Vec3d front((low.x() + high.x()) / 2, low.y() - (high - low).norm(), (low.z() + high.z()) / 2);
        options.peel = CutawayOptions::Peel{*o.peel, o.seed_face, o.from_A.value_or(front)};
    } else if (o.offset_A) {
        options.plane = CutawayOptions::Plane{*o.offset_A * o.normal, o.normal, !o.clip};
    } else {
        options.plane = plane_at(mesh, o.normal, o.at, !o.clip);
    }
    return options;
}

Image draw(const CutawayCommandOptions& o, const TriMesh& mesh, const Progress& progress) {
    RenderOptions render = o.render;
    if (!o.own_view) render.view = view_onto(mesh);
    render.edges = !o.no_edges;
    set_cut_colours(render, o.property);
    return vdbgeo::render(shown_cut(mesh, o.property), render, progress);
}

void run_cutaway(const CutawayCommandOptions& o, Session& session) {
    for (const std::string& path : {o.out, o.histogram}) check_folder_of(path);
    Json seconds;
    Clock clock;
    const TetMesh mesh = read_tets(o.in, session.stage("reading"));
    seconds["read"] = clock.lap();
    const auto quality_progress = session.stage("quality");
    const TetQuality quality = naming(o.in, [&] { return measure_tets(mesh, quality_progress); });
    const auto progress = session.stage("cutting");
    const CutawayOptions options = cutaway_options(o, mesh);
    const TriMesh out = naming(o.in, [&] { return cutaway(mesh, options, progress); });
    seconds["compute"] = clock.lap();
    if (!o.histogram.empty()) write_dihedral_histogram({{o.in, quality}}, o.histogram);
    if (o.picture())
        write_png(draw(o, out, session.stage("rendering")), o.out);
    else
        write_mesh(out, o.out, {}, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    const auto& interior = out.find_face_property(interior_property)->values;
    const auto opened = static_cast<std::uint64_t>(std::count(interior.begin(), interior.end(), 1.0f));
    Json j = tets_json(quality);
    j["mode"] = o.peel ? "peel" : o.clip ? "clip" : "whole";
    j["faces"] = out.triangles.size();
    j["interior_faces"] = opened;
    j["out"] = o.out;
    j["seconds"] = seconds;
    if (!session.json) {
        for (const std::string& line : tets_text(quality)) session.say(line);
        session.say(fmt::format("cutaway     {} faces, {} of them cut open", out.triangles.size(), opened));
    }
    session.result(j);
}

void add_cut_flags(CLI::App& app, CutawayCommandOptions& o) {
    app.add_option(
           "--plane", o.plane,
           "Take away what is before a plane across x, y or z in the views side, front and top, or on "
           "the side of a normal NX,NY,NZ; NX,NY,NZ,D: where NX x + NY y + NZ z > D, in Å")
        ->capture_default_str();
    app.add_option("--at", o.at, "Where along its normal the plane is: 0 nothing is left, 1 all")
        ->capture_default_str();
    app.add_flag("--clip", o.clip, "Cut tetrahedra flat [whole ones go whose middle is beyond the plane]");
    app.add_option("--peel", o.peel, "Instead of a plane: take away this many tetrahedra, breadth first")
        ->check(CLI::NonNegativeNumber.description(""));
    app.add_option("--seed-face", o.seed_face,
                   "The face of the boundary where a peel begins, from 0 [the one nearest to --from]")
        ->check(CLI::NonNegativeNumber.description(""));
    app.add_option("--from", o.from,
                   "Begin a peel at the face nearest to this place, x,y,z in Å [before the front]");
}

void add_picture_flags(CLI::App& app, CutawayCommandOptions& o) {
    app.add_option("--property", o.property,
                   "Picture: colour what is cut open by min_dihedral_deg, radius_edge, volume_A3 (in Å³) or "
                   "region")
        ->check(CLI::IsMember({"min_dihedral_deg", "radius_edge", "volume_A3", "region"}).description(""))
        ->capture_default_str();
    app.add_option("--min", o.render.range_min,
                   "Picture: value of the first colour [0° of angles, 0.6 of ratios, 2nd percentile]");
    app.add_option("--max", o.render.range_max,
                   "Picture: value of the last colour [70° of angles, 2 of ratios, 98th percentile]");
    app.add_flag("--no-edges", o.no_edges, "Picture: without the edges of the tetrahedra");
    app.add_option("--view", o.render.view,
                   "Picture: three, front, side, top, iso, or x,y,z: the direction towards the viewer [into "
                   "the opening]");
    app.add_option("--width", o.render.width, "Picture: width in pixels")->capture_default_str();
    app.add_option("--height", o.render.height, "Picture: height in pixels [what the view needs]");
    app.add_option("--samples", o.render.samples, "Picture: rays a pixel: 1, 4, 9 or 16")
        ->capture_default_str();
    app.add_option("--occlusion", o.render.occlusion_rays,
                   "Picture: rays of ambient occlusion each, 0 to 1024")
        ->capture_default_str();
    app.add_option("--title", o.render.title, "Picture: text above it [none]");
}

}  // namespace

Command cutaway_command() {
    return {"cutaway", "Look inside a tetrahedral mesh: what is left beyond a plane, or below a peel",
            "  vdbgeo cutaway groel.vtu inside.png\n"
            "  vdbgeo cutaway groel.vtu half.ply --plane z --clip\n"
            "  vdbgeo cutaway groel.vtu peeled.png --peel 100 --property radius_edge",
            [](CLI::App& app) {
                auto o = std::make_shared<CutawayCommandOptions>();
                app.add_option("in", o->in, "Tetrahedral mesh: " + tet_endings_text())->required();
                app.add_option("out", o->out,
                               "The boundary of what is left, as a picture (.png) or as a mesh with its "
                               "properties: " +
                                   mesh_endings_text())
                    ->required();
                add_cut_flags(app, *o);
                add_picture_flags(app, *o);
                app.add_option("--histogram", o->histogram,
                               "Plot the histogram of all dihedral angles of the mesh here (PNG or SVG)");
                return [o, flags = &app](Session& session) {
                    finish(*o, *flags);
                    run_cutaway(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
