// Flags of pictures that only `render` has.
#pragma once

#include <CLI/CLI.hpp>

#include "vdbgeo/view/render.h"

namespace vdbgeo::app {

/// Where to look, lines, and the background.
void add_scene_flags(CLI::App& app, RenderOptions& options);

}  // namespace vdbgeo::app
