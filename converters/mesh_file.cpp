#include "converters/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/tet_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using namespace mesh_formats;

struct Format {
    const char* ending;
    TriMesh (*read)(const MappedFile&, const Progress&);
    void (*write)(const TriMesh&, const Output&);
};

constexpr Format formats[] = {{".ply", read_ply, write_ply},     {".obj", read_obj, write_obj},
                              {".off", read_off, write_off},     {".stl", read_stl, write_stl},
                              {".vtp", read_vtk_xml, write_vtp}, {".vtu", read_vtk_xml, write_vtu},
                              {".glb", read_glb, write_glb}};

/// The name's ending in lower case.
std::string ending_of(const std::filesystem::path& path) {
    std::string ending = path.extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return ending;
}

/// The format that the name tells, nullptr for none.
const Format* format_of(const std::filesystem::path& path) {
    const std::string ending = ending_of(path);
    for (const Format& format : formats)
        if (ending == format.ending) return &format;
    return nullptr;
}

std::string known_endings() { return fmt::format("{}", fmt::join(mesh_endings(), ", ")); }

TriMesh read_any(const MappedFile& file, const std::filesystem::path& path, const Progress& progress) {
    if (file.bytes().empty()) throw InvalidInput(fmt::format("{}: the file is empty", file.name()));
    const Format* const format = format_of(path);
    // The first 80 bytes of a binary STL file are free, they may say "ply" as well.
    const bool stl = format && format->read == read_stl && is_binary_stl(file.bytes());
    if (!stl && is_ply(file.bytes())) return read_ply(file, progress);
    if (!stl && is_glb(file.bytes())) return read_glb(file, progress);
    if (!stl && is_vtk_xml(file.bytes())) return read_vtk_xml(file, progress);
    if (!stl && is_vtk_legacy(file.bytes())) return read_vtk_legacy(file, progress);
    if (!stl && is_off(file.bytes())) return read_off(file, progress);
    if (!format && is_tet_ending(path))
        throw InvalidInput(fmt::format(
            "{}: a file of tetrahedra, not of a surface; vdbgeo convert makes one of their boundary",
            file.name()));
    if (!format)
        throw InvalidInput(fmt::format(
            "{}: not a mesh: the content is none of PLY, OFF, glTF and VTK, and the ending none of {}",
            file.name(), known_endings()));
    return format->read(file, progress);
}

}  // namespace

namespace mesh_formats {

void put_point(Buffer& buffer, const Vec3f& p, const MeshWriteOptions& options) {
    const auto out = fmt::appender(buffer);
    if (options.digits)
        fmt::format_to(out, "{:.{}g} {:.{}g} {:.{}g}", p[0], *options.digits, p[1], *options.digits, p[2],
                       *options.digits);
    else
        fmt::format_to(out, "{} {} {}", p[0], p[1], p[2]);
}

void put_color(Buffer& buffer, const float* color) {
    fmt::format_to(fmt::appender(buffer), " {} {} {}", color_value(color[0]), color_value(color[1]),
                   color_value(color[2]));
}

}  // namespace mesh_formats

void MeshWriteOptions::check() const {
    if (digits && (*digits < 1 || *digits > 9))
        throw InvalidInput(fmt::format("digits: expected 1 to 9, found {}", *digits));
}

TriMesh read_mesh(const std::filesystem::path& path, const Progress& progress) {
    const MappedFile file(path);
    TriMesh mesh = read_any(file, path, progress);
    check(mesh, file.name());
    progress.report(1);
    return mesh;
}

void write_mesh(const TriMesh& mesh, const std::filesystem::path& path, const MeshWriteOptions& options,
                const Progress& progress) {
    options.check();
    const std::string name = path.string();
    const Format* const format = format_of(path);
    if (!format)
        throw InvalidInput(fmt::format("{}: not the name of a mesh file: expected an ending among {}", name,
                                       known_endings()));
    check(mesh, name);
    AtomicFile file(path);
    format->write(mesh, {file, name, options, progress});
    file.commit();
    progress.report(1);
}

std::vector<std::string> mesh_endings() {
    std::vector<std::string> endings;
    for (const Format& format : formats) endings.emplace_back(format.ending);
    return endings;
}

std::string mesh_endings_text() { return fmt::format("{}", fmt::join(mesh_endings(), " ")); }

bool is_mesh_ending(const std::filesystem::path& path) { return format_of(path) != nullptr; }

bool is_mesh_input(const std::filesystem::path& path) {
    return is_mesh_ending(path) || ending_of(path) == ".vtk";
}

}  // namespace vdbgeo
