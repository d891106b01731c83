#include "apps/report_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/report_words.h"
#include "apps/surface_flags.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/shape_types.h"
#include "vdbgeo/remesh/repair.h"
#include "vdbgeo/remesh/simplify.h"
#include "vdbgeo/surface/level_set.h"
#include "vdbgeo/tet/isosurface_stuffing.h"
#include "vdbgeo/tet/tet_quality.h"

namespace vdbgeo::app {
namespace {

/// Values of the vertices that come first, in this order; the others follow by name, as the file has them.
constexpr const char* first_properties[] = {"H",          "K",    "k1",     "k2",        "shape_index",
                                            "curvedness", "type", "pocket", "protrusion"};
constexpr int most_ids = 254;  ///< pockets with a colour: what a category can number

bool is_id(const std::string& name) { return name == "pocket" || name == "protrusion"; }

/// What no page shows: flags of the vertices, colours.
bool is_hidden(const MeshProperty& p) {
    return p.components != 1 || p.name == "curvature_flags" || p.name == "alpha" || p.values.empty();
}

PageProperty page_property(const MeshProperty& p) {
    const PropertyWords words = property_words(p.name);
    PageProperty page{p.name, words.name, words.unit, words.help, p.values, words.colormap, false, {}, {}};
    if (p.name == "shape_index") page.range = {-1, 1};
    if (p.name == "type") {
        page.category = true;
        for (std::size_t t = 0; t < surface_type_count; ++t)
            page.classes.emplace_back(static_cast<int>(t), name_of(static_cast<SurfaceType>(t)));
    } else if (is_id(p.name)) {
        page.category = true;
        float most = 0;
        for (float& v : page.values) {
            if (std::isfinite(v)) most = std::max(most, v);
            if (!(v >= 1)) v = std::numeric_limits<float>::quiet_NaN();
        }
        for (int id = 1; id <= std::min(most_ids, static_cast<int>(std::min(most, 1e6f))); ++id)
            page.classes.emplace_back(id, fmt::format("{} {}", p.name, id));
        if (most > most_ids) page.help += fmt::format(" The first {} have colours.", most_ids);
    }
    return page;
}

/// Corner `k`'s part of the point p of a triangle, by areas.
std::array<double, 3> parts_at(const TriMesh& mesh, const Triangle& t, const Vec3d& p) {
    std::array<Vec3d, 3> c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = mesh.points[t[k]].cast<double>();
    const Vec3d normal = (c[1] - c[0]).cross(c[2] - c[0]);
    const double whole = normal.squaredNorm();
    if (!(whole > 0)) return {1, 0, 0};
    std::array<double, 3> parts;
    for (std::size_t k = 0; k < 3; ++k)
        parts[k] = std::clamp((c[(k + 1) % 3] - p).cross(c[(k + 2) % 3] - p).dot(normal) / whole, 0.0, 1.0);
    return parts;
}

/// A scalar blended from the corners that have one; NaN where none has.
float blended(const std::vector<float>& values, const Triangle& t, const std::array<double, 3>& parts) {
    double sum = 0, weight = 0;
    for (std::size_t k = 0; k < 3; ++k)
        if (std::isfinite(values[t[k]]))
            sum += parts[k] * static_cast<double>(values[t[k]]), weight += parts[k];
    return weight > 0 ? static_cast<float>(sum / weight) : std::numeric_limits<float>::quiet_NaN();
}

/// The pieces with the most area whose faces together are at most so many.
TriMesh largest_pieces(const TriMesh& mesh, std::uint64_t faces, std::size_t& left_out) {
    const MeshComponents pieces = mesh_components(mesh);
    std::vector<bool> keep(pieces.components.size(), false);
    std::uint64_t sum = 0;
    left_out = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
        keep[i] = sum + pieces.components[i].faces <= faces;
        if (keep[i])
            sum += pieces.components[i].faces;
        else
            ++left_out;
    }
    return extract_components(mesh, pieces, keep);
}

}  // namespace

std::vector<PageProperty> page_properties(const TriMesh& mesh) {
    std::vector<PageProperty> properties;
    for (const char* name : first_properties)
        if (const MeshProperty* p = mesh.find_vertex_property(name))
            if (!is_hidden(*p)) properties.push_back(page_property(*p));
    for (const MeshProperty& p : mesh.vertex_properties) {
        const bool first = std::any_of(std::begin(first_properties), std::end(first_properties),
                                       [&](const char* name) { return p.name == name; });
        if (!first && !is_hidden(p)) properties.push_back(page_property(p));
    }
    return properties;
}

PageSurface::PageSurface(TriMesh mesh) : mesh_(std::move(mesh)), properties_(page_properties(mesh_)) {}

TriMesh PageSurface::reduced(std::uint64_t faces, std::vector<std::string>& remarks,
                             const Progress& progress) const {
    TriMesh bare;
    bare.points = mesh_.points;
    bare.triangles = mesh_.triangles;
    SimplifyOptions options;
    options.faces = faces;
    TriMesh shown;
    try {
        shown = simplify(bare, options, progress);
    } catch (const InvalidInput&) {  // no oriented manifold
        RepairOptions mending;
        mending.fill_holes = mending.self_intersections = false;
        shown = simplify(repair(bare, mending).mesh, options, progress);
    }
    std::size_t left_out = 0;
    if (shown.triangles.size() > faces) shown = largest_pieces(shown, faces, left_out);
    remarks.push_back(
        fmt::format("The surface shown is simplified from {} to {} triangles for this page; all "
                    "numbers are those of the full mesh.",
                    count_text(mesh_.triangles.size()), count_text(shown.triangles.size())));
    if (left_out > 0)
        remarks.push_back(
            fmt::format("Its {} smallest pieces are left out of the view.", count_text(left_out)));
    return shown;
}

std::vector<PageProperty> PageSurface::carried(const TriMesh& shown) {
    if (properties_.empty()) return {};
    if (!tree_) tree_ = std::make_unique<TriangleTree>(mesh_);
    std::vector<PageProperty> properties = properties_;
    for (PageProperty& p : properties) p.values.assign(shown.points.size(), 0);
    parallel_for(shown.points.size(), 256, [&](std::size_t v) {
        const TriangleTree::Nearest at = tree_->nearest(shown.points[v].cast<double>());
        const Triangle& t = mesh_.triangles[at.face];
        const std::array<double, 3> parts = parts_at(mesh_, t, at.point);
        const auto nearest =
            static_cast<std::size_t>(std::max_element(parts.begin(), parts.end()) - parts.begin());
        for (std::size_t i = 0; i < properties.size(); ++i)
            properties[i].values[v] = properties[i].category ? properties_[i].values[t[nearest]]
                                                             : blended(properties_[i].values, t, parts);
    });
    return properties;
}

PageMesh PageSurface::at_most(std::uint64_t faces, const Progress& progress) {
    if (mesh_.triangles.empty()) throw NumericalError("it has no triangles");
    PageMesh page;
    if (mesh_.triangles.size() <= faces) {
        page.shown = mesh_.triangles.size();
        page.json = packed_surface(mesh_, properties_, page.shown);
        return page;
    }
    const TriMesh shown = reduced(faces, page.remarks, progress);
    if (shown.empty()) throw NumericalError("no piece of it is small enough for this page");
    page.shown = shown.triangles.size();
    page.json = packed_surface(shown, carried(shown), mesh_.triangles.size());
    return page;
}

namespace {

PageProperty smallest_angles(const TetMesh& mesh) {
    const PropertyWords words = property_words("min_dihedral_deg");
    PageProperty p{"min_dihedral_deg", words.name, words.unit, words.help, {},
                   words.colormap,     false,      {},         {{0, 70}}};
    p.values.resize(mesh.tets.size());
    parallel_for(mesh.tets.size(), 1024, [&](std::size_t i) {
        const Tetrahedron& t = mesh.tets[i];
        p.values[i] = static_cast<float>(
            tet_shape(mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]], mesh.points[t[3]])
                .min_dihedral_deg);
    });
    return p;
}

/// The regions, where there are several and all can be numbered.
std::optional<PageProperty> region_property(const TetMesh& mesh) {
    if (mesh.regions.empty()) return {};
    const auto [least, most] = std::minmax_element(mesh.regions.begin(), mesh.regions.end());
    if (*least == *most || *most > most_ids) return {};
    PageProperty p{"region", "Region",      "",   "Parts of the specimen that the input told apart.",
                   {},       "categorical", true, {},
                   {}};
    p.values.assign(mesh.regions.begin(), mesh.regions.end());
    std::vector<bool> there(static_cast<std::size_t>(*most) + 1, false);
    for (const std::int32_t r : mesh.regions) there[static_cast<std::size_t>(r)] = true;
    for (std::size_t r = 0; r < there.size(); ++r)
        if (there[r]) p.classes.emplace_back(static_cast<int>(r), fmt::format("region {}", r));
    return p;
}

double mean_edge(const TetMesh& mesh) {
    double sum = 0;
    for (const Tetrahedron& t : mesh.tets)
        for (const auto& e : tet_edges)
            sum += (mesh.points[t[static_cast<std::size_t>(e[0])]] -
                    mesh.points[t[static_cast<std::size_t>(e[1])]])
                       .norm();
    return sum / (6 * static_cast<double>(mesh.tets.size()));
}

}  // namespace

TetMesh PageTets::coarser(std::uint64_t tets, const Progress& progress) {
    constexpr int most_tries = 12;
    constexpr double voxels_a_cell = 1.5, enough = 0.6;
    if (!boundary_) boundary_ = boundary_surface(mesh_);
    const auto wanted = static_cast<double>(tets);
    if (side_A_ == 0) side_A_ = mean_edge(mesh_) * std::sqrt(static_cast<double>(mesh_.tets.size()) / wanted);
    TetMesh best;
    double too_fine = 0, best_side = 0, side = side_A_;
    for (int i = 0; i < most_tries; ++i) {
        TetMesh filled;
        try {
            StuffingOptions options;
            // Filling is quick, distances to the boundary are not: one grid serves cells of several sizes.
            if (!inside_ || side < 0.75 * voxel_A_ || side > 3 * voxel_A_) {
                voxel_A_ = side / voxels_a_cell;
                inside_ = turned_over(map_from_grid(mesh_level_set(*boundary_, voxel_A_)));
            }
            options.cell = side / voxel_A_;
            filled = isosurface_stuffing(*inside_, 0, options);
        } catch (const NumericalError&) {  // so coarse that nothing is inside
        }
        const auto count = static_cast<double>(filled.tets.size());
        // Their number goes with the side's second power where the body is thin, with the third where not.
        if (count > wanted) {
            too_fine = side;
            side *= std::max(1.03, 1.02 * std::sqrt(count / wanted));
            if (best_side > 0) side = std::min(side, (too_fine + best_side) / 2);
        } else {
            if (filled.tets.size() > best.tets.size()) best = std::move(filled), best_side = side;
            if (count >= enough * wanted) break;
            const double finer = side * std::clamp(std::sqrt(count / wanted), 0.5, 0.95);
            side = too_fine > 0 ? std::max(finer, (too_fine + side) / 2) : finer;
        }
        progress.report(static_cast<double>(i + 1) / most_tries);
    }
    if (best.empty()) throw NumericalError("it has no filling with so few tetrahedra");
    side_A_ = best_side;
    return best;
}

PageMesh PageTets::at_most(std::uint64_t tets, const Progress& progress) {
    if (mesh_.tets.empty()) throw NumericalError("it has no tetrahedra");
    PageMesh page;
    if (mesh_.tets.size() <= tets) {
        std::vector<PageProperty> properties{smallest_angles(mesh_)};
        if (auto regions = region_property(mesh_)) properties.push_back(std::move(*regions));
        page.shown = mesh_.tets.size();
        page.json = packed_tets(mesh_, properties, page.shown);
        return page;
    }
    const TetMesh shown = coarser(tets, progress);
    page.shown = shown.tets.size();
    page.json = packed_tets(shown, {smallest_angles(shown)}, mesh_.tets.size());
    page.remarks.push_back(
        fmt::format("The tetrahedra shown are {} larger ones that fill the same body, made for this page in "
                    "place of the {} of "
                    "the model; all numbers are those of the model.",
                    count_text(page.shown), count_text(mesh_.tets.size())));
    return page;
}

}  // namespace vdbgeo::app
