// vdb2mrc: `vdbgeo convert` under the name that says what it does.
#include "apps/command.h"

int main(int argc, char** argv) {
    return vdbgeo::app::run(argc, argv, {vdbgeo::app::convert_command()}, "vdb2mrc", true);
}
