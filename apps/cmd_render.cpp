// vdbgeo render: pictures of meshes, of maps' surfaces and of sections through maps.
#include <fmt/format.h>

#include <charconv>
#include <filesystem>

#include "apps/command.h"
#include "apps/cutaway_picture.h"
#include "apps/flags.h"
#include "apps/render_flags.h"
#include "apps/render_slices.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/measure/shape_types.h"
#include "vdbgeo/view/png.h"

namespace vdbgeo::app {
namespace {

struct RenderCommandOptions {
    std::vector<std::string> files;  ///< the output last
    std::string out, labels, clip;
    std::vector<std::string> slice;
    bool slices = false;
    int turntable = 0;
    MapFlags map;
    IsoFlag iso;
    RenderOptions render;

    // What the texts mean, after finish().
    std::vector<std::string> names;  ///< of the inputs, above them
    SlicesInput sections;
    Isovalue rule;
    Vec3d clip_normal = Vec3d::Zero();
    double clip_at = 0.5;
    bool own_view = false;
};

std::vector<std::string> names_of(const RenderCommandOptions& o) {
    std::vector<std::string> names;
    if (o.labels.empty()) {
        for (const std::string& file : o.files)
            names.push_back(o.files.size() > 1 ? std::filesystem::path(file).filename().string() : "");
        return names;
    }
    for (std::size_t at = 0; at <= o.labels.size();) {
        const std::size_t end = std::min(o.labels.find(',', at), o.labels.size());
        names.push_back(o.labels.substr(at, end - at));
        at = end + 1;
    }
    if (names.size() != o.files.size())
        throw UsageError(
            fmt::format("--labels: '{}' has {} names for {} files", o.labels, names.size(), o.files.size()));
    return names;
}

void parse_clip(RenderCommandOptions& o) {
    if (o.clip.empty()) return;
    const std::size_t equals = o.clip.find('=');
    o.clip_normal = normal_across(o.clip.substr(0, equals));
    bool good = !o.clip_normal.isZero();
    if (good && equals != std::string::npos) {
        const char *at = o.clip.data() + equals + 1, *end = o.clip.data() + o.clip.size();
        const auto [rest, error] = std::from_chars(at, end, o.clip_at);
        good = error == std::errc() && rest == end && o.clip_at >= 0 && o.clip_at <= 1;
    }
    if (!good)
        throw UsageError(
            fmt::format("--clip: '{}' is not x, y or z, or one with a part of the way: x=0.25", o.clip));
}

void finish_slices(RenderCommandOptions& o, const CLI::App& flags) {
    refuse_flags(
        flags,
        {"--color-by", "--edges", "--view", "--zoom", "--focus", "--columns", "--height", "--samples",
         "--occlusion", "--no-scale-bar", "--no-silhouette", "--silhouettes-only", "--clip", "--turntable"},
        "means nothing to sections (--slices, --slice)");
    o.sections.files = o.files;
    o.sections.names = o.names;
    for (const std::string& text : o.slice) o.sections.wishes.push_back(SliceWish::parse(text));
    if (flags.get_option("--iso")->count() > 0) o.sections.contour = o.rule;
    o.sections.reading = o.map.options;
    for (const std::string& file : o.files)
        if (is_mesh_input(file) || (std::filesystem::exists(file) && holds_tets(file)))
            throw UsageError(fmt::format("{}: sections are of maps and grids, and this is a mesh", file));
}

void finish(RenderCommandOptions& o, const CLI::App& flags, Session& session) {
    if (o.files.size() < 2)
        throw UsageError("render: at least one file to draw and the picture to write are needed: IN OUT.png");
    o.out = o.files.back();
    o.files.pop_back();
    if (o.out != "-" && !has_ending(o.out, ".png"))
        throw UsageError(fmt::format("{}: pictures are PNG files: .png", o.out));
    if (flags.get_option("--turntable")->count() > 0) {
        if (o.out == "-") throw UsageError("--turntable writes numbered files: standard output takes one");
        if (flags.get_option("--view")->count() == 0) o.render.view = "front";
    }
    if (o.out == "-") take_output(session);
    o.map.finish();
    o.rule = o.iso.parse();
    o.names = names_of(o);
    parse_clip(o);
    o.own_view = flags.get_option("--view")->count() > 0;
    o.slices = o.slices || !o.slice.empty();
    if (o.slices) finish_slices(o, flags);
    check_usage(o.render);
    check_folder_of(o.out);
}

/// What is to be seen of a tetrahedral mesh that --clip cuts; the first one tells the view and the colours.
TriMesh clipped(const std::string& file, RenderCommandOptions& o, Session& session) {
    if (!holds_tets(file))
        throw UsageError(fmt::format("{}: --clip cuts tetrahedral meshes, and this is none", file));
    const TetMesh tets = read_tets(file, session.stage("reading"));
    const auto progress = session.stage("cutting");
    CutawayOptions cut;
    cut.plane = plane_at(tets, o.clip_normal, o.clip_at, false);
    TriMesh opened = naming(file, [&] { return cutaway(tets, cut, progress); });
    if (!o.own_view) {
        o.render.view = view_onto(opened);
        o.own_view = true;
    }
    set_cut_colours(o.render, o.render.property.value_or("min_dihedral_deg"));
    return shown_cut(std::move(opened), *o.render.property);
}

TriMesh load(const std::string& file, RenderCommandOptions& o, Session& session) {
    if (!o.clip.empty()) return clipped(file, o, session);
    if (holds_tets(file)) return boundary_surface(read_tets(file, session.stage("reading")));
    if (is_mesh_input(file)) return read_mesh(file, session.stage("reading"));
    const MapFile in = read_map(file, o.map.options, session.stage("reading"));
    for (const std::string& w : in.warnings) session.warn(file + ": " + w);
    return extract_surface(file, in, o.rule, session.stage("surface")).mesh;
}

/// "OUT_0001.png", counted from 1.
std::string frame_name(const std::string& out, int frame) {
    return fmt::format("{}_{:04d}.png", out.substr(0, out.size() - 4), frame + 1);
}

/// Draws the surfaces and returns the size of the picture, or of each frame.
std::pair<int, int> draw_surfaces(RenderCommandOptions& o, std::vector<std::string>& written,
                                  Session& session) {
    std::vector<TriMesh> meshes;
    for (const std::string& file : o.files) meshes.push_back(load(file, o, session));
    if (o.render.property == "type")
        for (std::size_t t = 0; t < surface_type_count; ++t)
            o.render.class_names[static_cast<int>(t)] = name_of(static_cast<SurfaceType>(t));
    std::vector<RenderItem> items;
    for (std::size_t i = 0; i < meshes.size(); ++i) items.push_back({&meshes[i], o.names[i]});
    std::pair<int, int> size;
    const auto progress = session.stage("rendering");
    const auto draw = [&] {
        render_turntable(
            items, std::max(1, o.turntable), o.render,
            [&](int frame, const Image& image) {
                size = {image.width, image.height};
                written.push_back(o.turntable > 0 ? frame_name(o.out, frame) : o.out);
                write_png(image, written.back());
            },
            progress);
    };
    if (items.size() > 1)
        draw();
    else
        naming(o.files[0], draw);
    return size;
}

void run_render(RenderCommandOptions& o, Session& session) {
    Clock clock;
    std::pair<int, int> size;
    std::vector<std::string> written;
    if (o.slices) {
        const Image image = slices_picture(o.sections, o.render, session);
        write_png(image, o.out);
        size = {image.width, image.height};
    } else {
        size = draw_surfaces(o, written, session);
    }
    session.end_stage();
    Json j{{"out", o.out}, {"width", size.first}, {"height", size.second}};
    if (o.turntable > 0) j["frames"] = written;
    j["seconds"] = clock.seconds();
    session.result(j);
}

void add_flags(CLI::App& app, RenderCommandOptions& o) {
    app.add_option(
           "files", o.files,
           "What to draw, beside each other at one scale: meshes (" + mesh_endings_text() +
               "), tetrahedral meshes (" + tet_endings_text() +
               "; their boundary), maps or VDB grids (their surface); then the picture to write: .png")
        ->required();
    app.add_option("--labels", o.labels,
                   "Names above what is drawn, with commas between [of several: the files']");
    app.add_flag("--slices", o.slices, "Sections through the middle of maps in place of their surfaces");
    app.add_option("--slice", o.slice,
                   "Such a section: x, y or z, or with a voxel from 0 (z=40) or a place in \u00c5 (z=120A); "
                   "several times for several")
        ->allow_extra_args(false);
    app.add_option("--clip", o.clip,
                   "Cut tetrahedral meshes across x, y or z, at a part of the way (x=0.25) [0.5 of it], and "
                   "colour what is inside");
    app.add_option("--turntable", o.turntable,
                   "Write this many frames of a full turn about the upright axis: OUT_0001.png \u2026")
        ->check(CLI::Range(1, 10000).description(""));
    add_render_flags(app, o.render);
    add_scene_flags(app, o.render);
    o.iso.add(app);
    o.map.add_reading(app);
}

}  // namespace

Command render_command() {
    return {
        "render", "Draw meshes, maps' surfaces or sections of maps as a PNG; no display is needed",
        "  vdbgeo render groel.ply groel.png --view iso\n"
        "  vdbgeo render emd_1080.map groel.ply both.png --labels map,mesh --view front --edges --zoom 4\n"
        "  vdbgeo render emd_1080.map slices.png --slices --iso 3sigma\n"
        "  vdbgeo render groel.vtu inside.png --clip y --edges\n"
        "  vdbgeo render groel.ply film.png --turntable 4 --background dark",
        [](CLI::App& app) {
            auto o = std::make_shared<RenderCommandOptions>();
            add_flags(app, *o);
            return [o, flags = &app](Session& session) {
                finish(*o, *flags, session);
                run_render(*o, session);
            };
        }};
}

}  // namespace vdbgeo::app
