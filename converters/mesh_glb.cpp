// glTF 2.0 in one binary file (.glb): a chunk of JSON that describes, and a chunk of bytes with the values.
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

using Json = nlohmann::ordered_json;  // attributes keep their order
using Mat4d = Eigen::Matrix4d;

constexpr std::uint32_t magic = 0x46546C67, json_chunk = 0x4E4F534A, bin_chunk = 0x004E4942;
constexpr std::uint64_t file_header = 12, chunk_header = 8;
enum ComponentType { int8 = 5120, uint8 = 5121, int16 = 5122, uint16 = 5123, uint32 = 5125, float32 = 5126 };
enum Mode { points = 0, triangles = 4, strip = 5, fan = 6 };
constexpr const char* type_names[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};

// Writing

/// Values on their way into the binary chunk: `components` of every `stride` floats, from `first` on.
struct Stream {
    std::string name;
    std::size_t components, stride, first;
    const float* values;
    bool color = false;
};

/// Area-weighted normals of the vertices; (0,0,1) where the faces have no area, for glTF wants unit vectors.
Array<Vec3f> vertex_normals(const TriMesh& mesh) {
    std::vector<Vec3d> sums(mesh.points.size(), Vec3d::Zero());
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        const Vec3d normal = (b - a).cross(c - a);
        for (const VertexId v : t) sums[v] += normal;
    }
    Array<Vec3f> normals(mesh.points.size());
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const double length = sums[i].stableNorm();
        normals[i] = length > 0 ? Vec3f((sums[i] / length).cast<float>()) : Vec3f(0, 0, 1);
    }
    return normals;
}

bool is_unit_normal(const MeshProperty& p) {
    if (p.name != "normal" || p.components != 3) return false;
    for (std::size_t i = 0; i + 2 < p.values.size(); i += 3) {
        const double length = Vec3d(p.values[i], p.values[i + 1], p.values[i + 2]).norm();
        if (!(std::abs(length - 1) < 1e-3)) return false;
    }
    return true;
}

std::vector<Stream> attribute_streams(const TriMesh& mesh, const Array<Vec3f>& normals) {
    std::vector<Stream> streams{{"POSITION", 3, 3, 0, mesh.points[0].data()}};
    if (!normals.empty()) streams.push_back({"NORMAL", 3, 3, 0, normals[0].data()});
    for (const MeshProperty& p : mesh.vertex_properties) {
        const std::size_t n = static_cast<std::size_t>(p.components);
        if (is_color(p))
            streams.push_back({"COLOR_0", 3, 3, 0, p.values.data(), true});
        else if (normals.empty() && is_unit_normal(p))
            streams.push_back({"NORMAL", 3, 3, 0, p.values.data()});
        else if (n <= 4)
            streams.push_back({"_" + p.name, n, n, 0, p.values.data()});
        else
            for (std::size_t k = 0; k < n; ++k)
                streams.push_back({fmt::format("_{}_{}", p.name, k), 1, n, k, p.values.data()});
    }
    return streams;
}

/// The description, as accessors are added to it one after the other.
class Description {
 public:
    Description() {
        json_["asset"] = {{"version", "2.0"}, {"generator", "vdbgeo"}, {"extras", {{"unit", "angstrom"}}}};
        json_["scene"] = 0;
    }
    Json& json() { return json_; }
    std::uint64_t bytes() const { return bytes_; }

    std::size_t add(std::uint64_t count, std::size_t components, ComponentType type, int target) {
        const std::uint64_t bytes = count * components * 4;
        json_["bufferViews"].push_back(
            {{"buffer", 0}, {"byteOffset", bytes_}, {"byteLength", bytes}, {"target", target}});
        Json& accessors = json_["accessors"];
        accessors.push_back({{"bufferView", accessors.size()},
                             {"componentType", type},
                             {"count", count},
                             {"type", type_names[components - 1]}});
        bytes_ += bytes;
        return accessors.size() - 1;
    }
    void set_range(std::size_t accessor, const Array<Vec3f>& points) {
        Vec3f low = points[0], high = low;
        for (const Vec3f& p : points) {
            low = low.cwiseMin(p);
            high = high.cwiseMax(p);
        }
        Json& a = json_["accessors"][accessor];
        a["min"] = {low[0], low[1], low[2]};
        a["max"] = {high[0], high[1], high[2]};
    }

 private:
    Json json_;
    std::uint64_t bytes_ = 0;
};

/// Describes the mesh; `computed`: its normals are no property of it.
void describe(const TriMesh& mesh, const std::vector<Stream>& streams, bool computed, Description& to) {
    Json primitive, attributes;
    for (const Stream& s : streams) {
        const std::size_t accessor = to.add(mesh.points.size(), s.components, float32, 34962);
        attributes[s.name] = accessor;
        if (s.name == "POSITION") to.set_range(accessor, mesh.points);
    }
    primitive["attributes"] = attributes;
    if (!mesh.triangles.empty()) primitive["indices"] = to.add(3 * mesh.triangles.size(), 1, uint32, 34963);
    primitive["mode"] = mesh.triangles.empty() ? points : triangles;
    primitive["material"] = 0;
    Json& json = to.json();
    json["meshes"] = Json::array({{{"primitives", Json::array({primitive})}}});
    if (computed) json["meshes"][0]["extras"] = {{"normals", "computed"}};
    const double grey = vertex_color(mesh) ? 1 : 0.8;
    json["materials"] = Json::array(
        {{{"pbrMetallicRoughness",
           {{"baseColorFactor", {grey, grey, grey, 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.7}}},
          {"doubleSided", true}}});
    json["nodes"] = Json::array({{{"mesh", 0}}});
    json["scenes"] = Json::array({{{"nodes", {0}}}});
    json["buffers"] = Json::array({{{"byteLength", to.bytes()}}});
}

void write_headers(const Output& out, std::string json, std::uint64_t bytes) {
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::uint64_t size =
        file_header + chunk_header + json.size() + (bytes > 0 ? chunk_header + bytes : 0);
    if (size > std::numeric_limits<std::uint32_t>::max())
        throw InvalidInput(
            fmt::format("{}: would take {} bytes, a glb file holds 2^32-1 at most", out.name, size));
    Buffer header;
    for (const std::uint64_t word : {std::uint64_t(magic), std::uint64_t(2), size, std::uint64_t(json.size()),
                                     std::uint64_t(json_chunk)})
        put(header, static_cast<std::uint32_t>(word));
    header.append(std::string_view(json));
    if (bytes > 0) {
        put(header, static_cast<std::uint32_t>(bytes));
        put(header, bin_chunk);
    }
    out.file.write(header.data(), header.size());
}

// Reading

/// The values that an accessor names, checked to lie in the file.
struct Accessor {
    const char* first = nullptr;
    std::uint64_t count = 0, stride = 0;
    std::size_t components = 1;
    std::uint64_t type = float32;
    bool normalized = false;

    float number(std::uint64_t i, std::size_t k) const {
        const char* const at = first + i * stride;
        switch (type) {
            case int8:
                return scaled<std::int8_t>(at, k);
            case uint8:
                return scaled<std::uint8_t>(at, k);
            case int16:
                return scaled<std::int16_t>(at, k);
            case uint16:
                return scaled<std::uint16_t>(at, k);
            case uint32:
                return scaled<std::uint32_t>(at, k);
            default:
                return load<float>(at + 4 * k, host_is_big_endian);
        }
    }
    std::uint32_t index(std::uint64_t i) const {
        const char* const at = first + i * stride;
        if (type == uint8) return load<std::uint8_t>(at, false);
        if (type == uint16) return load<std::uint16_t>(at, host_is_big_endian);
        return load<std::uint32_t>(at, host_is_big_endian);
    }

 private:
    template <class T>
    float scaled(const char* at, std::size_t k) const {
        const float value = static_cast<float>(load<T>(at + sizeof(T) * k, host_is_big_endian));
        return normalized ? std::max(value / static_cast<float>(std::numeric_limits<T>::max()), -1.0f)
                          : value;
    }
};

std::uint64_t component_bytes(std::uint64_t type) {
    return type == int8 || type == uint8 ? 1 : type == int16 || type == uint16 ? 2 : 4;
}

class Reader {
 public:
    Reader(const MappedFile& file, const Progress& progress) : file_(file), progress_(progress) {}

    TriMesh read() {
        take_chunks();
        check_extensions();
        place_nodes();
        return join_parts(std::move(parts_), file_.name());
    }

 private:
    void take_chunks();
    void check_extensions() const;
    void place_nodes();
    std::vector<std::uint64_t> roots() const;
    void place(const Json& mesh, std::uint64_t number, const Mat4d& to_world);
    void add_vertices(const Json& attributes, bool normals_are_computed, const Mat4d& to_world);
    void add_triangles(const Json& primitive, std::uint64_t mode, TriMesh& part, bool mirrored) const;
    Mat4d transform_of(const Json& node) const;
    Accessor accessor(std::uint64_t number) const;
    std::string_view view(const Json& accessor, std::uint64_t& stride) const;

    [[noreturn]] void fail(const std::string& message) const {
        throw InvalidInput(fmt::format("{}: {}", file_.name(), message));
    }
    /// json_[list][number]
    const Json& item(const char* list, std::uint64_t number) const {
        const auto found = json_.find(list);
        const std::size_t size = found != json_.end() && found->is_array() ? found->size() : 0;
        if (number >= size) fail(fmt::format("names number {} of {} {}", number, size, list));
        const Json& value = (*found)[number];
        if (!value.is_object()) fail(fmt::format("number {} of the {} is no object", number, list));
        return value;
    }
    std::optional<std::uint64_t> whole(const Json& object, const char* name) const {
        const auto found = object.find(name);
        if (found == object.end()) return {};
        return whole_value(*found, name);
    }
    std::uint64_t whole_value(const Json& value, const std::string& name) const {
        if (!value.is_number_integer() || (!value.is_number_unsigned() && value.get<std::int64_t>() < 0))
            fail(fmt::format("{}: expected a whole number", name));
        return value.get<std::uint64_t>();
    }
    std::uint64_t needed(const Json& object, const char* name) const {
        const auto value = whole(object, name);
        if (!value) fail(fmt::format("{} is missing", name));
        return *value;
    }
    /// The list of that name, empty where there is none.
    const Json& list(const Json& object, const char* name) const {
        static const Json nothing = Json::array();
        const auto found = object.find(name);
        if (found == object.end()) return nothing;
        if (!found->is_array()) fail(fmt::format("{}: expected a list", name));
        return *found;
    }
    std::vector<double> numbers(const Json& object, const char* name, std::size_t count,
                                std::vector<double> otherwise) const {
        if (!object.contains(name)) return otherwise;
        const Json& values = list(object, name);
        if (values.size() != count) fail(fmt::format("{}: expected {} numbers", name, count));
        for (std::size_t i = 0; i < count; ++i) {
            if (!values[i].is_number()) fail(fmt::format("{}: expected {} numbers", name, count));
            otherwise[i] = values[i].get<double>();
        }
        return otherwise;
    }

    const MappedFile& file_;
    const Progress& progress_;
    Json json_;
    std::string_view bin_;
    std::vector<TriMesh> parts_;
};

void Reader::take_chunks() {
    const std::string_view bytes = file_.bytes();
    const auto word = [&](std::uint64_t at) {
        return load<std::uint32_t>(bytes.data() + at, host_is_big_endian);
    };
    if (bytes.size() < file_header + chunk_header || word(0) != magic)
        fail("no glb file: it does not begin with glTF");
    if (word(4) != 2) fail(fmt::format("byte 4: expected version 2 of glTF, found {}", word(4)));
    const std::uint64_t size = word(8);
    if (size > bytes.size() || size < file_header + chunk_header)
        fail(fmt::format("byte 8: the file is told to have {} bytes, found {}", size, bytes.size()));
    for (std::uint64_t at = file_header; at + chunk_header <= size;) {
        const std::uint64_t length = word(at), type = word(at + 4), left = size - at - chunk_header;
        if (length > left)
            fail(fmt::format("byte {}: a chunk of {} bytes, found {} to the end", at, length, left));
        const std::string_view chunk = bytes.substr(at + chunk_header, length);
        if (at == file_header) {
            if (type != json_chunk) fail("byte 16: the first chunk is not the JSON");
            try {
                json_ = Json::parse(chunk);
            } catch (const Json::parse_error& error) {
                fail(fmt::format("byte {}: the JSON is damaged", file_header + chunk_header + error.byte));
            } catch (const Json::out_of_range&) {
                fail("a number of the JSON is out of range");
            }
            if (!json_.is_object()) fail("the JSON is no object");
        } else if (type == bin_chunk && bin_.empty()) {
            bin_ = chunk;
        }
        at += chunk_header + (length + 3) / 4 * 4;
    }
    progress_.report(0.1);
}

void Reader::check_extensions() const {
    for (const Json& name : list(json_, "extensionsRequired")) {
        const std::string text = name.is_string() ? name.get<std::string>() : "";
        const bool harmless = text.rfind("KHR_materials_", 0) == 0 || text.rfind("KHR_texture_", 0) == 0 ||
                              text == "KHR_mesh_quantization" || text == "KHR_lights_punctual";
        if (!harmless) fail(fmt::format("needs the extension {}, which is not read", in_quotes(text)));
    }
}

std::vector<std::uint64_t> Reader::roots() const {
    std::vector<std::uint64_t> found;
    if (json_.contains("scenes") && !list(json_, "scenes").empty()) {
        for (const Json& node : list(item("scenes", whole(json_, "scene").value_or(0)), "nodes"))
            found.push_back(whole_value(node, "node"));
        return found;
    }
    const std::size_t count = list(json_, "nodes").size();
    std::vector<bool> child(count);
    for (std::size_t i = 0; i < count; ++i)
        for (const Json& node : list(item("nodes", i), "children"))
            if (const std::uint64_t c = whole_value(node, "child"); c < count) child[c] = true;
    for (std::size_t i = 0; i < count; ++i)
        if (!child[i]) found.push_back(i);
    return found;
}

void Reader::place_nodes() {
    if (list(json_, "nodes").empty()) {
        for (std::size_t i = 0; i < list(json_, "meshes").size(); ++i)
            place(item("meshes", i), i, Mat4d::Identity());
        return;
    }
    std::vector<bool> seen(list(json_, "nodes").size());
    std::vector<std::pair<std::uint64_t, Mat4d>> waiting;
    const auto wait = [&](const std::vector<std::uint64_t>& nodes, const Mat4d& parent) {
        for (std::size_t i = nodes.size(); i-- > 0;)
            waiting.emplace_back(nodes[i], parent);  // the first is taken first
    };
    wait(roots(), Mat4d::Identity());
    for (std::size_t done = 0; !waiting.empty(); ++done) {
        const auto [number, parent] = waiting.back();
        waiting.pop_back();
        const Json& node = item("nodes", number);
        if (seen[number]) fail(fmt::format("node {} is in the scene twice", number));
        seen[number] = true;
        const Mat4d to_world = parent * transform_of(node);
        if (const auto mesh = whole(node, "mesh")) place(item("meshes", *mesh), *mesh, to_world);
        std::vector<std::uint64_t> children;
        for (const Json& child : list(node, "children")) children.push_back(whole_value(child, "child"));
        wait(children, to_world);
        progress_.report(0.1 + 0.9 * static_cast<double>(done) / static_cast<double>(seen.size()));
    }
}

Mat4d Reader::transform_of(const Json& node) const {
    if (node.contains("matrix")) return Mat4d(numbers(node, "matrix", 16, std::vector<double>(16)).data());
    const auto t = numbers(node, "translation", 3, {0, 0, 0}), r = numbers(node, "rotation", 4, {0, 0, 0, 1}),
               s = numbers(node, "scale", 3, {1, 1, 1});
    Mat4d m = Mat4d::Identity();
    m.topLeftCorner<3, 3>() =
        Eigen::Quaterniond(r[3], r[0], r[1], r[2]).toRotationMatrix() * Vec3d(s[0], s[1], s[2]).asDiagonal();
    m.topRightCorner<3, 1>() = Vec3d(t[0], t[1], t[2]);
    return m;
}

void Reader::place(const Json& mesh, std::uint64_t number, const Mat4d& to_world) {
    const auto extras = mesh.find("extras");
    const bool computed =
        extras != mesh.end() && extras->is_object() && extras->value("normals", Json()) == "computed";
    const bool mirrored = to_world.topLeftCorner<3, 3>().determinant() < 0;
    std::map<std::string, std::size_t> parts;  // primitives with the same vertices are one
    for (const Json& primitive : list(mesh, "primitives")) {
        if (!primitive.is_object() || !primitive.contains("attributes") ||
            !primitive["attributes"].is_object())
            fail(fmt::format("mesh {}: a primitive without attributes", number));
        const std::uint64_t mode = whole(primitive, "mode").value_or(triangles);
        if (mode != points && mode != triangles && mode != strip && mode != fan) continue;  // lines
        const Json& attributes = primitive["attributes"];
        if (!attributes.contains("POSITION")) continue;
        for (const auto& [name, accessor] : attributes.items())
            if (!accessor.is_number_integer())  // deep nesting, which dump() would follow, among others
                fail(fmt::format("mesh {}: the attribute '{}' names no accessor", number, name));
        const auto [part, fresh] = parts.try_emplace(attributes.dump(), parts_.size());
        if (fresh) add_vertices(attributes, computed, to_world);
        if (mode != points) add_triangles(primitive, mode, parts_[part->second], mirrored);
    }
}

void Reader::add_vertices(const Json& attributes, bool normals_are_computed, const Mat4d& to_world) {
    TriMesh part;
    const Accessor position = accessor(needed(attributes, "POSITION"));
    if (position.components != 3) fail("POSITION: expected 3 components");
    if (position.count > TriMesh::max_vertices)
        fail(fmt::format("{} vertices, more than 2^32-1", position.count));
    const bool moved = !to_world.isIdentity(0);
    const Mat3d linear = to_world.topLeftCorner<3, 3>();
    part.points.resize(position.count);
    for (std::uint64_t i = 0; i < position.count; ++i) {
        Vec3f p(position.number(i, 0), position.number(i, 1), position.number(i, 2));
        if (moved) p = (linear * p.cast<double>() + to_world.topRightCorner<3, 1>()).cast<float>();
        part.points[i] = p;
        if (i % report_every == 0) progress_.report(0.1);
    }
    const Mat3d turn = linear.inverse().transpose() * (linear.determinant() < 0 ? -1.0 : 1.0);
    for (const auto& [name, value] : attributes.items()) {
        const bool normal = name == "NORMAL" && !normals_are_computed, color = name == "COLOR_0";
        if (!normal && !color && name[0] != '_') continue;
        const Accessor a = accessor(whole_value(value, name));
        if (a.count != position.count)
            fail(fmt::format("{}: {} values for {} vertices", in_quotes(name), a.count, position.count));
        const std::size_t n = normal || color ? 3 : a.components;
        if (a.components < n) fail(fmt::format("{}: expected 3 components", name));
        MeshProperty p{normal ? "normal" : color ? "color" : name.substr(1), static_cast<int>(n), {}};
        if (p.name.empty() || part.find_vertex_property(p.name)) continue;
        p.values.reserve(n * a.count);
        for (std::uint64_t i = 0; i < a.count; ++i)
            for (std::size_t k = 0; k < n; ++k) p.values.push_back(a.number(i, k));
        if (normal && moved)
            for (std::size_t i = 0; i < p.values.size(); i += 3) {
                const Eigen::Map<Vec3f> v(&p.values[i]);
                Eigen::Map<Vec3f>(&p.values[i]) = (turn * v.cast<double>()).stableNormalized().cast<float>();
            }
        part.vertex_properties.push_back(std::move(p));
    }
    parts_.push_back(std::move(part));
}

void Reader::add_triangles(const Json& primitive, std::uint64_t mode, TriMesh& part, bool mirrored) const {
    std::optional<Accessor> indices;
    if (const auto number = whole(primitive, "indices")) {
        indices = accessor(*number);
        const bool fits = indices->type == uint8 || indices->type == uint16 || indices->type == uint32;
        if (!fits || indices->components != 1)
            fail(fmt::format("accessor {}: indices are no whole numbers", *number));
    }
    const std::uint64_t count = indices ? indices->count : part.points.size();
    const auto corner = [&](std::uint64_t i) {
        const std::uint64_t v = indices ? indices->index(i) : i;
        if (v >= part.points.size())
            fail(fmt::format("a corner names vertex {} of {}", v, part.points.size()));
        return static_cast<VertexId>(v);
    };
    if (mode == triangles && count % 3 != 0)
        fail(fmt::format("{} corners, which is no multiple of 3", count));
    const std::uint64_t faces = mode == triangles ? count / 3 : count < 3 ? 0 : count - 2;
    part.triangles.reserve(part.triangles.size() + faces);
    for (std::uint64_t f = 0; f < faces; ++f) {
        std::array<std::uint64_t, 3> at{f, f + 1, f + 2};
        if (mode == triangles) at = {3 * f, 3 * f + 1, 3 * f + 2};
        if (mode == strip && f % 2 == 1) std::swap(at[1], at[2]);
        if (mode == fan) at[0] = 0;
        if (mirrored) std::swap(at[1], at[2]);
        part.triangles.push_back({corner(at[0]), corner(at[1]), corner(at[2])});
        if (f % report_every == 0) progress_.report(0.1);
    }
}

/// The bytes of the accessor from its first value on.
std::string_view Reader::view(const Json& accessor, std::uint64_t& stride) const {
    if (accessor.contains("sparse")) fail("sparse accessors are not read");
    const std::uint64_t number = needed(accessor, "bufferView");
    const Json& view = item("bufferViews", number);
    const std::uint64_t buffer = needed(view, "buffer");
    if (buffer != 0 || item("buffers", 0).contains("uri"))
        fail("values outside the file's own chunk are not read");
    const std::uint64_t offset = whole(view, "byteOffset").value_or(0), length = needed(view, "byteLength");
    if (offset > bin_.size() || length > bin_.size() - offset)
        fail(fmt::format("bufferView {}: {} bytes from byte {} on, found {} in all", number, length, offset,
                         bin_.size()));
    stride = whole(view, "byteStride").value_or(stride);
    const std::uint64_t first = whole(accessor, "byteOffset").value_or(0);
    if (first > length) fail(fmt::format("bufferView {}: an accessor begins behind its end", number));
    return bin_.substr(offset + first, length - first);
}

Accessor Reader::accessor(std::uint64_t number) const {
    const Json& json = item("accessors", number);
    Accessor a;
    a.type = needed(json, "componentType");
    if ((a.type < int8 || a.type > uint16) && a.type != uint32 && a.type != float32)
        fail(fmt::format("accessor {}: unknown type of components {}", number, a.type));
    const Json name = json.value("type", Json());
    const auto type = std::find(std::begin(type_names), std::end(type_names), name);
    if (type == std::end(type_names))
        fail(fmt::format("accessor {}: expected SCALAR, VEC2, VEC3 or VEC4", number));
    a.components = static_cast<std::size_t>(type - std::begin(type_names)) + 1;
    a.count = needed(json, "count");
    a.normalized = json.value("normalized", Json()) == true;
    const std::uint64_t each = a.components * component_bytes(a.type);
    a.stride = each;
    const std::string_view bytes = view(json, a.stride);
    const bool fits = a.count == 0 || (bytes.size() >= each && a.stride > 0 &&
                                       a.count - 1 <= (bytes.size() - each) / a.stride);
    if (a.stride < each || !fits)
        fail(fmt::format("accessor {}: {} values of {} bytes, found {} bytes", number, a.count, each,
                         bytes.size()));
    a.first = bytes.data();
    return a;
}

}  // namespace

bool is_glb(std::string_view bytes) { return bytes.substr(0, 4) == "glTF"; }

TriMesh read_glb(const MappedFile& file, const Progress& progress) { return Reader(file, progress).read(); }

void write_glb(const TriMesh& mesh, const Output& out) {
    check_names(mesh.vertex_properties, out.name, "glTF");
    Description description;
    if (mesh.points.empty()) {
        description.json()["scenes"] = Json::array({{{"name", "empty"}}});
        return write_headers(out, description.json().dump(), 0);
    }
    const MeshProperty* const own = mesh.find_vertex_property("normal");
    const bool computed = !mesh.triangles.empty() && !(own && is_unit_normal(*own));
    const Array<Vec3f> normals = computed ? vertex_normals(mesh) : Array<Vec3f>();
    const std::vector<Stream> streams = attribute_streams(mesh, normals);
    describe(mesh, streams, computed, description);
    write_headers(out, description.json().dump(), description.bytes());
    for (std::size_t s = 0; s < streams.size(); ++s) {
        const Stream& stream = streams[s];
        const double n = static_cast<double>(streams.size() + 1);
        write_elements(out.file, mesh.points.size(), out.progress.part(double(s) / n, double(s + 1) / n),
                       [&](std::size_t i, Buffer& buffer) {
                           const float* const from = stream.values + i * stream.stride + stream.first;
                           for (std::size_t k = 0; k < stream.components; ++k)
                               put(buffer, stream.color ? color_value(from[k]) : from[k]);
                       });
    }
    write_elements(out.file, mesh.triangles.size(), out.progress, [&](std::size_t i, Buffer& buffer) {
        for (const VertexId v : mesh.triangles[i]) put(buffer, v);
    });
}

}  // namespace vdbgeo::mesh_formats
