// Flags of the operators of vdbgeo/flow, bound to their options.
#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

#include "apps/session.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/checkpoint_options.h"
#include "vdbgeo/flow/coupled_high_pass.h"
#include "vdbgeo/flow/geometric_flow.h"
#include "vdbgeo/flow/hyperdiffusion.h"
#include "vdbgeo/flow/level_set_flow.h"
#include "vdbgeo/flow/pde_transform.h"

namespace vdbgeo::app {

/// "1" or "0,1": numbers with commas between them; UsageError naming `flag` for anything else.
std::vector<double> parse_numbers(const std::string& flag, const std::string& text);
std::vector<int> parse_integers(const std::string& flag, const std::string& text);

/// "fsi", "euler", "adi".
const char* name_of(Stepper stepper);

/// --sigma
struct SigmaFlag {
    std::string text;  ///< empty: the default
    void add(CLI::App& app, const EdgeScale& fallback);
    /// Sets `sigma` where the flag was given; UsageError.
    void finish(EdgeScale& sigma) const;
};

struct DiffusionFlags {
    HyperdiffusionOptions options;
    std::string orders, diffusivities, time;
    SigmaFlag sigma;

    /// The flags, so that a command can tell which were given.
    std::vector<CLI::Option*> add(CLI::App& app);
    void finish();
};

struct HighPassFlags {
    HighPassOptions options;
    std::string coupling;
    SigmaFlag sigma;

    void add(CLI::App& app);
    void finish();
};

struct TransformFlags {
    TransformOptions options;
    std::string orders, times, band_pass, keep;
    SigmaFlag sigma;
    /// Which modes are summed, from 0; the residue is behind the last. Empty: all are written, one by one.
    std::vector<bool> kept;

    void add(CLI::App& app);
    void finish();
};

struct FlowFlags {
    GeometricFlowOptions density;
    LevelSetFlowOptions surface;
    std::string surface_kind;  ///< empty: a flow of the density
    std::optional<double> time, dt;

    void add(CLI::App& app);
    void finish();

 private:
    std::vector<CLI::Option*> of_density_, of_surface_;
};

/// --checkpoint, --checkpoint-every, --resume
struct CheckpointFlags {
    CheckpointOptions options;
    void add(CLI::App& app);
    /// Makes SIGTERM and SIGUSR1 ask for a checkpoint and the end, where there are any; UsageError.
    void finish();
    /// Runs a computation; where it was stopped, says where its checkpoint is.
    template <class Body>
    auto run(Session& session, const Body& body) const -> decltype(body()) {
        try {
            return body();
        } catch (const Cancelled&) {
            say_stopped(session);
            throw;
        }
    }
    /// Once the result is written: nothing is left to resume. By one member of a team.
    void remove(const Session& session) const;

 private:
    void say_stopped(Session& session) const;
};

/// What a diffusion did: active_voxels, dt, steps, time, mean_before, mean_after, state_bytes.
Json report_json(const HyperdiffusionReport& report);
/// The same in one line.
std::string steps_text(const HyperdiffusionReport& report);

}  // namespace vdbgeo::app
