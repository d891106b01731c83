// One view of a model by rays of light. Used by render only.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/view/layout.h"
#include "vdbgeo/view/ray_caster.h"
#include "vdbgeo/view/view_model.h"

namespace vdbgeo {

/// Everything that the pixels of a picture of one mesh share.
struct Scene {
    const ViewModel& model;
    const RayCaster& rays;
    const RenderOptions& options;
    const MeshProperty* property;  ///< to colour by, or none
    bool of_faces;                 ///< the property
    const std::optional<ColourScale>& scale;
    const MeshProperty* hidden_edges;
    int grid;  ///< samples along a pixel's side
};

/// Draws the model into the panel's rectangle. `box` is the model's in the panel's view.
void draw_panel(Image& image, const Scene& scene, double pixels_per_A, const Panel& panel, const ViewBox& box,
                const Progress& progress);

}  // namespace vdbgeo
