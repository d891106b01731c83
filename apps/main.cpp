#include "apps/command.h"

int main(int argc, char** argv) {
    return vdbgeo::app::run(argc, argv, vdbgeo::app::all_commands(), "vdbgeo", false);
}
