#include "apps/reports.h"

#include <Eigen/Core>
#include <fmt/format.h>
#include <tbb/version.h>

#include "apps/build_info.h"
#include "converters/streamed_grid.h"

namespace vdbgeo::app {
namespace {

const char* class_name(openvdb::GridClass c) {
    switch (c) {
        case openvdb::GRID_LEVEL_SET:
            return "level set";
        case openvdb::GRID_FOG_VOLUME:
            return "fog volume";
        case openvdb::GRID_STAGGERED:
            return "staggered";
        default:
            return "unknown";
    }
}

Json matrix_json(const Frame& frame) {
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r)
        rows.push_back({frame.axes(r, 0), frame.axes(r, 1), frame.axes(r, 2), frame.origin[r]});
    return rows;
}

}  // namespace

Json versions_json() {
    return {{"vdbgeo", VDBGEO_VERSION},
            {"build", VDBGEO_BUILD_TYPE},
            {"sanitizers", VDBGEO_SANITIZERS},
            {"openvdb", openvdb::getLibraryVersionString()},
            {"tbb", fmt::format("{}.{}", TBB_VERSION_MAJOR, TBB_VERSION_MINOR)},
            {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
            {"embree", VDBGEO_EMBREE_VERSION},
            {"nanovdb", VDBGEO_NANOVDB_VERSION},
            {"cgal", VDBGEO_CGAL_VERSION},
            {"tetgen", VDBGEO_TETGEN_VERSION},
            {"netgen", VDBGEO_NETGEN_VERSION},
            {"mpi", VDBGEO_MPI_VERSION},
            {"three.js", VDBGEO_THREE_VERSION}};
}

std::string versions_text() {
    std::string text = fmt::format("vdbgeo {}", VDBGEO_VERSION);
    const Json versions = versions_json();
    for (const auto& [name, version] : versions.items())
        if (name != "vdbgeo" && !version.get<std::string>().empty())
            text += fmt::format("\n{:<10} {}", name, version.get<std::string>());
    return text;
}

Json to_json(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

Json one_sided_json(const OneSidedDistance& d) {
    return {{"max_A", d.max}, {"p999_A", d.p999}, {"rms_A", d.rms}, {"mean_A", d.mean}};
}

Json measures_json(const MeshMeasures& m) {
    Json j;
    j["vertices"] = m.vertices;
    j["faces"] = m.faces;
    j["components"] = m.components;
    j["genus"] = m.genus ? Json(*m.genus) : Json();
    j["closed"] = m.closed;
    j["boundary_edges"] = m.boundary_edges;
    j["area_A2"] = m.area_A2;
    j["volume_A3"] = m.volume_A3 ? Json(*m.volume_A3) : Json();
    j["min_angle_deg"] = m.min_angle_deg;
    j["max_angle_deg"] = m.max_angle_deg;
    j["mean_angle_deg"] = m.mean_angle_deg;
    j["below_30_percent"] = 100 * m.angles_below_30_fraction;
    j["radius_edge_max"] = m.radius_edge_max;
    j["radius_edge_mean"] = m.radius_edge_mean;
    j["cap_area_A2"] = m.cap_area_A2;
    j["holes"] = m.holes;
    j["duplicate_faces"] = m.duplicate_faces;
    j["misoriented_edges"] = m.misoriented_edges;
    j["euler_characteristic"] = m.euler_characteristic;
    j["manifold"] = m.manifold;
    j["oriented"] = m.oriented;
    j["non_manifold_edges"] = m.non_manifold_edges;
    j["non_manifold_vertices"] = m.non_manifold_vertices;
    j["degenerate_faces"] = m.degenerate_faces;
    j["unused_vertices"] = m.unused_vertices;
    return j;
}

std::vector<std::string> measures_text(const MeshMeasures& m) {
    std::vector<std::string> lines{
        fmt::format("vertices    {}", m.vertices),
        fmt::format("faces       {}", m.faces),
        fmt::format("components  {}", m.components),
        fmt::format("genus       {}",
                    m.genus ? fmt::format("{}", *m.genus) : "told of closed manifolds only"),
        fmt::format(
            "closed      {}",
            m.closed ? "yes" : fmt::format("no, {} boundary edges in {} holes", m.boundary_edges, m.holes)),
        fmt::format("area        {:.6g} Å²", m.area_A2),
        fmt::format("volume      {}",
                    m.volume_A3 ? fmt::format("{:.6g} Å³", *m.volume_A3) : "told of closed surfaces only"),
        fmt::format("angles      {:.3g}° to {:.4g}°, {:.3g} % below 30°", m.min_angle_deg, m.max_angle_deg,
                    100 * m.angles_below_30_fraction),
        fmt::format("radius-edge {:.3g} mean, {:.3g} largest (0.577 is ideal)", m.radius_edge_mean,
                    m.radius_edge_max)};
    if (m.cap_area_A2 > 0) lines.push_back(fmt::format("caps        {:.6g} Å²", m.cap_area_A2));
    if (m.duplicate_faces > 0) lines.push_back(fmt::format("duplicate   {} faces", m.duplicate_faces));
    if (!m.manifold)
        lines.push_back(fmt::format("not manifold: {} edges, {} vertices, {} degenerate faces",
                                    m.non_manifold_edges, m.non_manifold_vertices, m.degenerate_faces));
    if (!m.oriented) lines.push_back(fmt::format("not oriented: {} edges", m.misoriented_edges));
    return lines;
}

Json mrc_json(const MrcReader& reader, const Statistics& s, const std::vector<std::string>& warnings) {
    const MrcHeader& h = reader.header();
    const Frame& f = reader.frame();
    Json j;
    j["nx"] = f.size.x();
    j["ny"] = f.size.y();
    j["nz"] = f.size.z();
    j["mode"] = h.mode;
    j["value_type"] = reader.value_type();
    j["voxel_size_A"] = to_json(f.voxel_size());
    j["origin_A"] = to_json(f.origin);
    j["origin_rule"] = reader.origin_rule();
    j["axis_order"] = {h.mapc, h.mapr, h.maps};
    j["cell_A"] = h.cell;
    j["cell_angles_deg"] = h.angles;
    j["nstart"] = {h.nxstart, h.nystart, h.nzstart};
    j["sampling"] = {h.mx, h.my, h.mz};
    j["space_group"] = h.ispg;
    j["extended_header_bytes"] = h.nsymbt;
    j["byte_order"] = h.swapped ? "swapped" : "native";
    j["volumes"] = reader.volumes();
    j["min"] = s.min;
    j["max"] = s.max;
    j["mean"] = s.mean;
    j["rms"] = s.rms;
    j["non_finite"] = s.non_finite;
    j["header_statistics"] = {{"min", h.dmin}, {"max", h.dmax}, {"mean", h.dmean}, {"rms", h.rms}};
    j["labels"] = h.labels;
    j["warnings"] = warnings;
    return j;
}

Json frame_json(const Frame& f) {
    return {{"size", {f.size.x(), f.size.y(), f.size.z()}},
            {"voxel_size_A", to_json(f.voxel_size())},
            {"origin_A", to_json(f.origin)}};
}

Json statistics_json(const Statistics& s) {
    return {{"min", s.min}, {"max", s.max}, {"mean", s.mean}, {"rms", s.rms}};
}

Json grid_json(const DensityMap& map) {
    const openvdb::FloatGrid& grid = *map.grid;
    const Frame& f = map.frame;
    const auto box = grid.evalActiveVoxelBoundingBox();
    const Vec3d extent =
        f.bounded() ? f.size.cast<double>() : Vec3d(box.dim().x(), box.dim().y(), box.dim().z());
    Json j;
    j["name"] = grid.getName();
    j["active_voxels"] = grid.activeVoxelCount();
    const auto* streamed = dynamic_cast<const StreamedGrid*>(&grid);
    j["leaves"] = streamed ? streamed->leaves().leaves() : grid.constTree().leafCount();
    j["bytes_in_memory"] = grid.memUsage();
    j["dense_bytes"] = static_cast<std::uint64_t>(4 * extent.prod());
    j["background"] = grid.background();
    j["class"] = class_name(grid.getGridClass());
    j["transform"] = matrix_json(f);
    j.update(frame_json(f));
    if (!box.empty()) {
        j["active_box_min"] = {box.min().x(), box.min().y(), box.min().z()};
        j["active_box_max"] = {box.max().x(), box.max().y(), box.max().z()};
    }
    j.update(statistics_json(map.statistics));
    return j;
}

std::vector<std::string> as_lines(const Json& object) {
    std::size_t width = 0;
    for (const auto& item : object.items()) width = std::max(width, item.key().size());
    std::vector<std::string> lines;
    for (const auto& [key, value] : object.items()) {
        if (value.is_array() && !value.empty() && value[0].is_string()) {
            for (const auto& text : value)
                lines.push_back(fmt::format("{:<{}}  {}", key, width, text.get<std::string>()));
        } else if (value.is_string()) {
            lines.push_back(fmt::format("{:<{}}  {}", key, width, value.get<std::string>()));
        } else if (!(value.is_array() && value.empty())) {
            lines.push_back(fmt::format("{:<{}}  {}", key, width, json_text(value)));
        }
    }
    return lines;
}

}  // namespace vdbgeo::app
