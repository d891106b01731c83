// A diffusion that writes down where it is, and goes on from there.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "vdbgeo/core/team.h"
#include "vdbgeo/flow/checkpoint_options.h"
#include "vdbgeo/flow/cycles.h"

namespace vdbgeo {

/// Takes a solver's cycles and writes its fields into a folder after every so many of them. There are two
/// generations, a and b, each a folder of a file for each member and of a list, which is written last and
/// names the files with their hashes: a generation is there once its list is, and the one before is there
/// until then. The list has what was done too (cycles, and what was found between them), with the hash of the
/// map and the options.
///
/// Resuming, who drives the cycles does so from the first one on: those that were taken are answered from the
/// list. So it comes to the same decisions, and to the same bytes, whoever had which part of the map before.
class CheckpointedSolver : public CycleSolver {
 public:
    /// `what`: all that the result depends on but the map, as text. `solver` and `team` have to live as long.
    /// InvalidInput where the checkpoint to resume from is of another map or other options; IoError.
    CheckpointedSolver(CycleSolver& solver, const CheckpointOptions& options, const std::string& what,
                       Team* team);

    bool constant_coefficients() const override { return solver_.constant_coefficients(); }
    std::uint64_t active_voxels() const override { return solver_.active_voxels(); }
    /// Cancelled once a checkpoint is written because it was time to end.
    void cycle(Stepper stepper, int n, double tau, const Progress& progress) override;
    void reset() override;
    double removed() override;
    std::uint64_t input_hash() override { return solver_.input_hash(); }
    std::size_t fields() const override { return solver_.fields(); }
    void save(StateWriter& writer) override { solver_.save(writer); }
    void load(const StateReader& reader) override { solver_.load(reader); }

    /// Cycles that were taken before, by those who wrote the checkpoint.
    int resumed() const { return resumed_; }

 private:
    struct Entry {
        int steps = 0;  ///< 0: back to u = X
        double tau = 0, removed = -1;
    };
    struct List;

    bool anyone(bool mine) const;
    void resume();
    std::vector<List> lists() const;
    bool whole(const List& list) const;
    void write();
    std::filesystem::path generation(int number) const;

    CycleSolver& solver_;
    CheckpointOptions options_;
    Team* team_;
    std::string key_;
    std::vector<Entry> log_;
    std::size_t next_ = 0;  // entry of the log; its size: nothing is answered from it any more
    int written_ = 0, since_ = 0, resumed_ = 0;
};

/// Calls `body` with the solver, or with one that writes its checkpoints where a folder is given. Cycles that
/// were taken before come back.
int with_checkpoints(CycleSolver& solver, const CheckpointOptions& options, const std::string& what,
                     Team* team, const std::function<void(CycleSolver&)>& body);

/// Takes the generations out of a folder, and nothing else; the folder too where nothing is left.
void remove_checkpoints(const std::filesystem::path& folder);

}  // namespace vdbgeo
