// Pictures of triangle meshes without a display.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/view/image.h"

namespace vdbgeo {

struct RenderOptions {
    int width = 1600;           ///< pixels, 64…Image::max_side
    std::optional<int> height;  ///< pixels; unset: what the views need at this width, at most the width
    /// "front" (seen along +y: x to the right, z up), "side" (seen along −x: y right, z up), "top" (seen
    /// along −z: x right, y up), "iso" (from the front, right and above), or "three": front, side and top
    /// beside each other at one scale; or three numbers "x,y,z": the direction towards the viewer, z up in
    /// the picture (y where it looks along z).
    std::string view = "three";
    double zoom = 1;             ///< larger than what fills the picture, 0.1…100; the rest is cut off
    std::optional<Vec3d> focus;  ///< what lies in the middle of each view, Å; unset: the middle of the mesh
    /// Meshes of one view in a row; unset: up to three, else about as many as rows.
    std::optional<int> columns;

    /// Scalar property to colour by: of the vertices, blended over the faces, or else of the faces, each in
    /// one colour. Unset: one plain colour.
    std::optional<std::string> property;
    std::optional<std::string> label;  ///< under the colour scale, with its unit; unset: property_text's
    std::optional<double> range_min;   ///< value of the first colour; unset: 2nd percentile of the property
    std::optional<double> range_max;   ///< value of the last colour; unset: 98th percentile
    /// One of Colormap::names(); unset: "categorical" for classes that property_text knows, "diverging" where
    /// the range has both signs, else "sequential". The percentile range of a diverging map is made symmetric
    /// about 0. With "categorical" the values are rounded to class numbers and the ranges have no meaning.
    std::optional<std::string> colormap;
    std::map<int, std::string> class_names;  ///< shown as a legend; empty: the classes' numbers are

    int samples = 4;         ///< antialiasing: 1, 4, 9 or 16 primary rays a pixel
    int occlusion_rays = 6;  ///< rays of ambient occlusion for each of them, 0 (none)…1024
    bool shadows = true;     ///< soft shadow of the key light
    bool outline = true;  ///< dark lines where the surface hides a farther part of itself or the background
    bool lines_only = false;  ///< a drawing: outlines and edges on a surface in the background's colour

    /// Thin dark lines along the edges of the faces, but for those that the face property
    /// hidden_edges_property (core/hidden_edges.h) flags. Where faces have but a few pixels the lines fade.
    bool edges = false;

    Vec3f surface{0.47f, 0.67f, 0.85f};  ///< sRGB, outside of the surface where no property colours it
    Vec3f inside{0.86f, 0.62f, 0.36f};  ///< sRGB, inside: seen through a hole, or where faces are turned over
    Vec3f background{1, 1, 1};          ///< sRGB

    std::string title;        ///< above the picture; empty: none
    bool scale_bar = true;    ///< a bar of round length in Å, nm or µm
    bool axis_labels = true;  ///< the view's name and the directions of x, y, z under each view

    /// Throws InvalidInput naming the first option out of its range.
    void check() const;
};

/// Whether this build has a ray caster (embree). Without it `render` throws InvalidInput.
bool can_render();

/// A shaded picture of the mesh by orthographic ray casting: key light from the upper left of the viewer and
/// a weak fill light, both fixed to the camera, ambient occlusion over half the mesh's radius
/// (cosine-weighted, lengths falling off linearly), a soft shadow, slight fading with depth. All views have
/// the same scale. Occlusion and shadow are averaged over neighbouring samples on the same piece of surface,
/// so that they show no noise.
///
/// Coarse meshes look smooth. Vertex normals are Σ e × f / (|e|² |f|²) over the corners at a vertex with
/// edges e, f (N. Max, "Weights for computing vertex normals from facet normals", J. Graphics Tools 4(2),
/// 1999), exact on a sphere however uneven its triangles. Rays of occlusion and shadow start from
/// P − Σ bᵢ min(0, (P − Vᵢ)·nᵢ) nᵢ for the point P of a face with vertices Vᵢ, normals nᵢ and barycentric
/// coordinates bᵢ (J. Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, 2021), and fill the
/// hemisphere of the smooth normal, so that faces do not shade themselves where they stand for a convex
/// surface. The price: sharp creases look rounded, and their shadows begin a little off the faces. Outlines
/// keep the mesh's corners.
///
/// Any triangle mesh will do: open, non-manifold, with zero-area faces; points no face uses are ignored. A
/// back face shows in the colour `inside`, or in the darkened colour of its property. NaN is grey for
/// vertices; faces with NaN have the plain colour. The mesh is centred and scaled in double precision first:
/// neither its size nor its distance from the origin matters beyond the precision of its float coordinates.
///
/// Same mesh and options → same bytes, for any number of threads.
///
/// Errors: InvalidInput for bad options, an empty or damaged mesh, a mesh whose points all coincide, an
/// unknown or non-scalar property, a build without embree; Cancelled by the progress.
///
/// Cost: width · height · samples · (3 + occlusion_rays) rays where the surface is, those of occlusion and
/// shadow cast eight at a time; 64 bytes a vertex and 80 a face of memory besides the picture.
Image render(const TriMesh& mesh, const RenderOptions& options = {}, const Progress& progress = {});

/// A mesh in a picture of several.
struct RenderItem {
    const TriMesh* mesh;
    std::string name;  ///< above it, and before what is found wrong with it; empty: none
};

/// Several meshes beside each other at one scale, in rows of `columns` (with a view of three, a row for
/// each), and with one scale of colours over all of their values. Meshes that take about the same room (each
/// is at least 0.8 of all together) are shown in one frame, so that the same place lies at the same pixel;
/// others are centred each. Errors as above, and InvalidInput for no mesh.
Image render(const std::vector<RenderItem>& items, const RenderOptions& options = {},
             const Progress& progress = {});

/// The meshes turning about the upright axis of the picture (z, or y where the view looks along z), by
/// 360°/frames from one frame to the next, counter-clockwise seen from above. All frames have the same size,
/// scale and colours, and the first is in the view that the options name. Each is handed to `take` with its
/// number, from 0. Errors as above, and InvalidInput unless frames lies in 1…10000.
void render_turntable(const std::vector<RenderItem>& items, int frames, const RenderOptions& options,
                      const std::function<void(int, const Image&)>& take, const Progress& progress = {});

}  // namespace vdbgeo
