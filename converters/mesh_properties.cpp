#include "converters/mesh_properties.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

using Properties = std::vector<MeshProperty>;

const MeshProperty* find_like(const Properties& properties, const MeshProperty& like) {
    for (const MeshProperty& p : properties)
        if (p.name == like.name && p.components == like.components) return &p;
    return nullptr;
}

Properties common(const std::vector<TriMesh>& parts, Properties TriMesh::*properties) {
    std::vector<const Properties*> all;
    for (const TriMesh& part : parts) all.push_back(&(part.*properties));
    return common_properties(all);
}

}  // namespace

const MeshProperty* vertex_color(const TriMesh& mesh) {
    const MeshProperty* const color = mesh.find_vertex_property("color");
    return color && is_color(*color) ? color : nullptr;
}

void check_names(const Properties& properties, const std::string& file, const char* format) {
    std::set<std::string> taken;
    for (const MeshProperty& p : properties) {
        const bool printable =
            std::all_of(p.name.begin(), p.name.end(), [](char c) { return c >= ' ' && c <= '~'; });
        if (p.name.empty() || !printable)
            throw InvalidInput(fmt::format("{}: a property is called {}, which {} cannot hold", file,
                                           in_quotes(p.name), format));
        if (!taken.insert(p.name).second)
            throw InvalidInput(fmt::format("{}: two properties would be called '{}'", file, p.name));
    }
}

Properties common_properties(const std::vector<const Properties*>& parts) {
    Properties joined;
    if (parts.empty()) return joined;
    for (const MeshProperty& first : *parts[0]) {
        MeshProperty all{first.name, first.components, {}};
        bool everywhere = true;
        for (const Properties* part : parts) {
            const MeshProperty* const own = find_like(*part, first);
            if (!own) everywhere = false;
            if (!everywhere) break;
            all.values.insert(all.values.end(), own->values.begin(), own->values.end());
        }
        if (everywhere) joined.push_back(std::move(all));
    }
    return joined;
}

TriMesh join_parts(std::vector<TriMesh> parts, const std::string& file) {
    if (parts.empty()) return {};
    if (parts.size() == 1) return std::move(parts[0]);
    TriMesh mesh;
    mesh.vertex_properties = common(parts, &TriMesh::vertex_properties);
    mesh.face_properties = common(parts, &TriMesh::face_properties);
    for (TriMesh& part : parts) {
        const std::size_t first = mesh.points.size();
        if (first + part.points.size() > TriMesh::max_vertices)
            throw InvalidInput(fmt::format("{}: more than 2^32-1 vertices", file));
        mesh.points.insert(mesh.points.end(), part.points.begin(), part.points.end());
        for (Triangle t : part.triangles) {
            for (VertexId& v : t) v += static_cast<VertexId>(first);
            mesh.triangles.push_back(t);
        }
        part = {};
    }
    return mesh;
}

}  // namespace vdbgeo::mesh_formats
