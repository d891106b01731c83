// Steps that several commands share: they read files, call the library, and say what they found.
#pragma once

#include <optional>
#include <string>

#include "apps/plots.h"
#include "apps/session.h"
#include "apps/surface_flags.h"
#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/measure/isovalue_table.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/volume/isovalue.h"
#include "vdbgeo/volume/phantom.h"

namespace vdbgeo::app {

struct Surface {
    TriMesh mesh;
    double isovalue = 0;
};

/// Runs `body` for the file `name`, which is put before what is found wrong.
template <class Body>
auto naming(const std::string& name, const Body& body) -> decltype(body()) {
    try {
        return body();
    } catch (const InvalidInput& e) {
        throw InvalidInput(name + ": " + e.what());
    } catch (const NumericalError& e) {
        throw NumericalError(name + ": " + e.what());
    }
}

/// The surface of a map by marching cubes, or as the flags say; of a level set (negative inside) with its
/// faces turned outward. NumericalError where nothing crosses the isovalue, telling the map's range.
Surface extract_surface(const std::string& name, const MapFile& in, const Isovalue& rule,
                        const Progress& progress, const SurfaceFlags& flags = {});

/// For a command that writes a file to standard output; UsageError with --json, which wants it too.
void take_output(Session& session);

/// UsageError unless a map can be written under this name: .vdb, .nvdb, the endings of map files, plain or
/// with .gz, or "-", which is an MRC file on standard output.
void check_map_output(const std::string& path, Session& session);

/// Writes a map in the format that the name tells; what there is to say of an MRC file comes back.
std::optional<MrcWriteReport> write_map(const DensityMap& map, const std::string& path,
                                        const VdbWriteOptions& vdb, const MrcWriteOptions& mrc,
                                        const Progress& progress);

/// A phantom as a map, with its noise or without.
DensityMap phantom_map(const Phantom& phantom, bool truth, const Progress& progress);

/// One line where the surface is open: it can be so only where the density meets the border of the map.
void say_where_open(const MeshMeasures& measures, Session& session);

/// One file a piece, by area, the largest first: OUT_0001.ply … Returns their names.
std::vector<std::string> write_pieces(const TriMesh& mesh, const std::string& path, const Progress& progress);

/// IoError unless the folder of an output file is there: for commands that write several, so that none is
/// left when another cannot be made. An empty name and "-" need none.
void check_folder_of(const std::string& path);

/// UsageError unless a mesh can be written under this name.
void check_mesh_output(const std::string& path);

/// The histogram of the triangles' angles (the paper's Fig 7) as a plot; of several meshes as curves.
void write_angle_histogram(const MeshMeasures& measures, const std::string& path,
                           const Theme& theme = Theme::light());
void write_angle_histograms(const std::vector<std::pair<std::string, MeshMeasures>>& meshes,
                            const std::string& path, const Theme& theme = Theme::light());

/// Volume, area and pieces of a surface over the isovalue, as a plot; one isovalue marked, if given.
void plot_isovalues(const std::vector<IsovalueRow>& rows, const std::string& path,
                    const std::optional<MarkedLevel>& level = std::nullopt,
                    const Theme& theme = Theme::light());

bool has_ending(const std::string& name, const std::string& ending);

}  // namespace vdbgeo::app
