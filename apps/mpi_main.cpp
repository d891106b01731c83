// vdbgeo-mpi: commands of vdbgeo on several processes, each with a part of the map.
#include "apps/command.h"
#include "vdbgeo/blocks/mpi_team.h"

int main(int argc, char** argv) {
    vdbgeo::MpiRun mpi(argc, argv);
    const vdbgeo::app::TeamRun team{&mpi.team(),
                                    [&](int code, const std::function<void()>& say) { mpi.fail(code, say); }};
    return vdbgeo::app::run(argc, argv, vdbgeo::app::team_commands(), "vdbgeo-mpi", false, team);
}
