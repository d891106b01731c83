#include "vdbgeo/view/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/hidden_edges.h"
#include "vdbgeo/view/layout.h"
#include "vdbgeo/view/ray_caster.h"
#include "vdbgeo/view/shading.h"
#include "vdbgeo/view/view_model.h"

namespace vdbgeo {

void RenderOptions::check() const {
    const auto need = [](bool good, const std::string& message) {
        if (!good) throw InvalidInput(message);
    };
    const auto side = [&](const char* name, int value) {
        need(value >= 64 && value <= Image::max_side,
             fmt::format("{} of {} pixels is not in 64 to {}", name, value, Image::max_side));
    };
    const auto colour = [&](const char* name, const Vec3f& c) {
        need(c.allFinite() && c.minCoeff() >= 0 && c.maxCoeff() <= 1,
             fmt::format("{} colour ({}, {}, {}) is not in 0 to 1", name, c[0], c[1], c[2]));
    };
    side("width", width);
    if (height) side("height", *height);
    find_views(view);
    need(zoom >= 0.1 && zoom <= 100, fmt::format("zoom {} is not in 0.1 to 100", zoom));
    need(!focus || focus->allFinite(), "the focus is not a place of finite coordinates");
    need(!columns || (*columns >= 1 && *columns <= 100),
         fmt::format("columns: {} is not in 1 to 100", columns.value_or(0)));
    if (colormap) Colormap{*colormap};
    need(samples == 1 || samples == 4 || samples == 9 || samples == 16,
         fmt::format("samples a pixel: {} is not 1, 4, 9 or 16", samples));
    need(occlusion_rays >= 0 && occlusion_rays <= 1024,
         fmt::format("occlusion rays: {} is not in 0 to 1024", occlusion_rays));
    need(!range_min || std::isfinite(*range_min), "the colour range's minimum is not a finite number");
    need(!range_max || std::isfinite(*range_max), "the colour range's maximum is not a finite number");
    need(!range_min || !range_max || *range_min < *range_max,
         fmt::format("the colour range {} to {} is empty", range_min.value_or(0), range_max.value_or(0)));
    need(!lines_only || outline || edges, "a drawing of lines without outlines and edges is empty");
    need(!lines_only || !property, "a drawing of lines has no colours of a property");
    colour("surface", surface);
    colour("inside", inside);
    colour("background", background);
}

#ifndef VDBGEO_HAS_EMBREE

bool can_render() { return false; }

void render_turntable(const std::vector<RenderItem>&, int, const RenderOptions& options,
                      const std::function<void(int, const Image&)>&, const Progress&) {
    options.check();
    throw InvalidInput("this build has no ray caster (embree): pictures of surfaces cannot be made");
}

#else

namespace {

/// The property to colour by, of the vertices or else of the faces.
const MeshProperty* find_property(const TriMesh& mesh, const RenderOptions& options) {
    if (!options.property) return nullptr;
    const MeshProperty* found = mesh.find_vertex_property(*options.property);
    if (!found) found = mesh.find_face_property(*options.property);
    if (found && found->components == 1) return found;
    if (found)
        throw InvalidInput(fmt::format("property '{}' has {} components: colours need a scalar", found->name,
                                       found->components));
    std::string names;
    for (const auto* properties : {&mesh.vertex_properties, &mesh.face_properties})
        for (const MeshProperty& p : *properties) names += (names.empty() ? "" : ", ") + p.name;
    throw InvalidInput(fmt::format("the mesh has no property '{}'; it has {}", *options.property,
                                   names.empty() ? "none" : names));
}

/// The faces' flags, where they are flags.
const MeshProperty* find_hidden_edges(const TriMesh& mesh, const RenderOptions& options) {
    const MeshProperty* found = options.edges ? mesh.find_face_property(hidden_edges_property) : nullptr;
    if (!found || found->components != 1) return nullptr;
    const auto flags = [](float v) { return v >= 0 && v <= 7; };
    return std::all_of(found->values.begin(), found->values.end(), flags) ? found : nullptr;
}

/// A mesh ready to be drawn.
class Subject {
 public:
    Subject(const RenderItem& item, const RenderOptions& options)
        : name(item.name),
          property(find_property(*item.mesh, options)),
          hidden_edges(find_hidden_edges(*item.mesh, options)),
          of_faces(property && !item.mesh->find_vertex_property(*options.property)),
          model(make_view_model(*item.mesh)),
          rays(model.points, item.mesh->triangles) {}

    std::string name;
    const MeshProperty *property, *hidden_edges;
    bool of_faces;
    ViewModel model;
    RayCaster rays;
};

std::unique_ptr<Subject> make_subject(const RenderItem& item, const RenderOptions& options) {
    try {
        if (item.mesh->empty()) throw InvalidInput("the mesh has no faces: there is nothing to see");
        check(*item.mesh, "render");
        return std::make_unique<Subject>(item, options);
    } catch (const InvalidInput& e) {
        throw InvalidInput(item.name.empty() ? e.what() : item.name + ": " + e.what());
    }
}

/// Subjects, how they are turned, and the one frame that all their pictures have.
class Studio {
 public:
    Studio(const std::vector<RenderItem>& items, int frames, const RenderOptions& options)
        : options_(options), frames_(frames) {
        options.check();
        if (items.empty()) throw InvalidInput("no mesh is given to be drawn");
        if (frames < 1 || frames > 10000)
            throw InvalidInput(fmt::format("{} frames are not in 1 to 10000", frames));
        for (const RenderItem& item : items) subjects_.push_back(make_subject(item, options));
        if (options.property) {
            std::vector<float> values;
            for (const auto& s : subjects_)
                values.insert(values.end(), s->property->values.begin(), s->property->values.end());
            scale_ = choose_scale(values, options);
        }
        const std::vector<View> views = find_views(options.view);
        for (const View& view : views) turns_.push_back(boxes_of_turns(view));
        columns_ =
            views.size() > 1  ? views.size()
            : options.columns ? static_cast<std::size_t>(*options.columns)
            : subjects_.size() < 4
                ? subjects_.size()
                : static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(subjects_.size()))));
        columns_ = std::min(columns_, subjects_.size() * views.size());
        arrange_cells(views);
    }

    Image draw(int frame, const Progress& progress) const {
        Image image(layout_.width, layout_.height, options_.background);
        const int grid = static_cast<int>(std::lround(std::sqrt(options_.samples)));
        const double n = static_cast<double>(layout_.panels.size());
        Layout layout = layout_;
        for (std::size_t i = 0; i < layout.panels.size(); ++i) {
            const Subject& s = *subjects_[i / turns_.size()];
            const Turn& turn = turns_[i % turns_.size()];
            Panel& panel = layout.panels[i];
            panel.view = turn.views[static_cast<std::size_t>(frame)];
            if (const auto place = middle_of(s)) panel.middle = in_view(s, panel.view, *place).head<2>();
            const Scene scene{s.model,    s.rays, options_,       s.property,
                              s.of_faces, scale_, s.hidden_edges, grid};
            const double k = static_cast<double>(i);
            draw_panel(image, scene, layout.pixels_per_A, panel,
                       turn.boxes[static_cast<std::size_t>(frame)][i / turns_.size()],
                       progress.part(k / n, (k + 1) / n));
        }
        draw_decorations(image, layout, options_, scale_);
        return image;
    }

 private:
    /// A view in each frame, and there the box of each subject relative to its own middle.
    struct Turn {
        std::vector<View> views;
        std::vector<std::vector<ViewBox>> boxes;
    };

    Turn boxes_of_turns(const View& view) const {
        Turn turn;
        for (int frame = 0; frame < frames_; ++frame) {
            turn.views.push_back(frame == 0 ? view : turned(view, 2 * M_PI * frame / frames_));
            turn.boxes.emplace_back();
            for (const auto& s : subjects_)
                turn.boxes.back().push_back(box_in_view(s->model, turn.views.back()));
        }
        return turn;
    }

    /// A place of the world, as seen from a subject's middle.
    static Vec3d in_view(const Subject& s, const View& view, const Vec3d& place) {
        const Vec3d p = place - s.model.centre;
        return {p.dot(view.right), p.dot(view.up), p.dot(view.towards)};
    }

    /// Whether the subjects take about the same room: the middle of it, or none.
    std::optional<Vec3d> common_middle() const {
        Vec3d low = Vec3d::Constant(1e300), high = -low;
        double smallest = 1e300;
        const View& any = turns_[0].views[0];
        for (std::size_t i = 0; i < subjects_.size(); ++i) {
            const ViewBox& box = turns_[0].boxes[0][i];
            const Vec3d shift = -in_view(*subjects_[i], any, Vec3d::Zero());
            low = low.cwiseMin(box.low + shift), high = high.cwiseMax(box.high + shift);
            smallest = std::min(smallest, (box.high - box.low).norm());
        }
        if (subjects_.size() < 2 || smallest < 0.8 * (high - low).norm()) return {};
        const Vec3d m = (low + high) / 2;
        return Vec3d(m.x() * any.right + m.y() * any.up + m.z() * any.towards);
    }

    /// The place of the world in the middle of a subject's pictures; none: the middle of its box in the view.
    std::optional<Vec3d> middle_of(const Subject& s) const {
        if (options_.focus) return *options_.focus;
        if (common_) return common_;
        if (frames_ > 1) return s.model.centre;
        return {};
    }

    /// What subject i needs in all frames, about the one place that they turn about.
    ViewBox room_of(std::size_t i, const Turn& turn) const {
        const std::optional<Vec3d> place = common_ || frames_ == 1 ? common_ : middle_of(*subjects_[i]);
        if (!place) return turn.boxes[0][i];
        Vec3d reach = Vec3d::Zero();
        for (std::size_t f = 0; f < turn.views.size(); ++f) {
            const Vec3d m = in_view(*subjects_[i], turn.views[f], *place);
            reach = reach.cwiseMax(turn.boxes[f][i].high - m).cwiseMax(m - turn.boxes[f][i].low);
        }
        const Vec3d m = in_view(*subjects_[i], turn.views[0], *place);
        return {m - reach, m + reach};
    }

    void arrange_cells(const std::vector<View>& views) {
        std::vector<Cell> cells;
        common_ = common_middle();
        for (std::size_t i = 0; i < subjects_.size(); ++i)
            for (std::size_t v = 0; v < views.size(); ++v) {
                const ViewBox box = room_of(i, turns_[v]);
                cells.push_back({views[v], box, box.middle(), v == 0 ? subjects_[i]->name : std::string()});
            }
        layout_ = arrange(cells, columns_, options_);
    }

    const RenderOptions& options_;
    int frames_;
    std::vector<std::unique_ptr<Subject>> subjects_;
    std::optional<ColourScale> scale_;
    std::vector<Turn> turns_;  // one a view
    std::size_t columns_ = 1;
    std::optional<Vec3d> common_;  // the middle of all, where they take about the same room
    Layout layout_;
};

}  // namespace

bool can_render() { return true; }

void render_turntable(const std::vector<RenderItem>& items, int frames, const RenderOptions& options,
                      const std::function<void(int, const Image&)>& take, const Progress& progress) {
    progress.report(0);
    const Studio studio(items, frames, options);
    for (int frame = 0; frame < frames; ++frame)
        take(frame, studio.draw(frame, progress.part(double(frame) / frames, (frame + 1.0) / frames)));
}

#endif

Image render(const std::vector<RenderItem>& items, const RenderOptions& options, const Progress& progress) {
    Image image;
    render_turntable(
        items, 1, options, [&](int, const Image& drawn) { image = drawn; }, progress);
    return image;
}

Image render(const TriMesh& mesh, const RenderOptions& options, const Progress& progress) {
    return render({{&mesh, ""}}, options, progress);
}

}  // namespace vdbgeo
