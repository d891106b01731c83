// The steps of a geometric flow, wherever the map is.
#pragma once

#include "vdbgeo/flow/geometric_flow.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {

class FlowSteps {
 public:
    virtual ~FlowSteps() = default;
    /// The longest step that is stable, given what there is now.
    virtual double bound() = 0;
    /// S += dt S_t. What there is then.
    virtual stencil::FieldSummary take(double dt) = 0;
};

/// Steps up to the time that the options ask for. Adds to the report's steps and time; its dt is the longest
/// step. `before`: of X. Errors as geometric_flow.
void take_flow_steps(FlowSteps& flow, const stencil::FieldSummary& before,
                     const GeometricFlowOptions& options, HyperdiffusionReport& report,
                     const Progress& progress);

}  // namespace vdbgeo
