// What the commands from mesh to mesh share: read, check, work, compare, write.
#pragma once

#include <CLI/CLI.hpp>

#include <functional>
#include <string>

#include "apps/session.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/measure/mesh_measures.h"

namespace vdbgeo::app {

struct MeshCommandFlags {
    std::string in, out;
    bool no_distance = false;

    /// `distance`: whether the command measures how far its result is from its input.
    void add(CLI::App& app, bool distance);
};

/// The mesh before and after, and what there is to tell.
struct MeshWork {
    const TriMesh& in;
    const MeshMeasures& before;
    const Progress& progress;
    Json& json;  ///< more keys for the result
};

/// Reads the mesh, runs `work`, measures the result and its two-sided distance to the input, writes it, and
/// prints both. InvalidInput names the file.
void run_mesh_command(const MeshCommandFlags& flags, const std::string& stage, Session& session,
                      const std::function<TriMesh(const MeshWork&)>& work);

}  // namespace vdbgeo::app
