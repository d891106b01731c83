// The processes of an MPI run as a team.
#pragma once

#include <functional>
#include <memory>

#include "vdbgeo/core/team.h"

namespace vdbgeo {

/// Begins MPI for this process, and ends it again. Only the thread that made it may call MPI: the others
/// compute.
class MpiRun {
 public:
    MpiRun(int& argc, char**& argv);
    ~MpiRun();
    MpiRun(const MpiRun&) = delete;
    MpiRun& operator=(const MpiRun&) = delete;

    /// All processes.
    Team& team();

    /// To be called by a process that gives up: ends the run with this exit code. Of those that fail within
    /// two seconds the first calls `say`. Where all do, as where all see the same fault, they return from
    /// here, to end; otherwise they take the rest down, and do not return.
    void fail(int code, const std::function<void()>& say);

 private:
    class Members;
    std::unique_ptr<Members> members_;
};

}  // namespace vdbgeo
