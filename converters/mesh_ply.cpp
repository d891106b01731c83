// PLY: a text header that declares elements and their properties, then the values as text or binary.
#include "converters/mesh_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <utility>

#include "converters/mesh_formats.h"
#include "converters/mesh_pieces.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

/// The values of an ascii file: an entry a line.
class AsciiBody {
 public:
    AsciiBody(const MappedFile& file, const PlyHeader& header)
        : text_(file.bytes().substr(header.body), file.name(), '\0', header.body_line),
          size_(text_.remaining()) {}

    void begin(const PlyElement& element, std::uint64_t entry) {
        if (!text_.next_line())
            text_.fail(fmt::format("the file ends where entry {} of {} of element {} is expected", entry,
                                   element.count, in_quotes(element.name)));
    }
    void end() { text_.expect_line_end(); }
    float number(const PlyProperty& property) { return text_.number(property.name.c_str()); }
    std::int64_t integer(PlyType, const PlyProperty& property) {
        return text_.integer(property.name.c_str());
    }
    void require(std::uint64_t values, const PlyProperty& property) const {
        if (values > text_.remaining() / 2 + 1)
            fail(
                fmt::format("{}: a list of {} values that the file is too short for", property.name, values));
    }
    double done() const { return static_cast<double>(text_.offset()) / static_cast<double>(size_); }
    void finish() {
        if (text_.next_line())
            fail(fmt::format("expected the end of the file, found {}", in_quotes(text_.word())));
    }
    [[noreturn]] void fail(const std::string& message) const { text_.fail(message); }

 private:
    TextCursor text_;
    std::size_t size_;
};

/// The values of a binary file, one after the other.
class BinaryBody {
 public:
    BinaryBody(const MappedFile& file, const PlyHeader& header)
        : bytes_(file.bytes()),
          at_(header.body),
          swap_((header.encoding == PlyHeader::Encoding::big_endian) != host_is_big_endian),
          file_(file.name()) {}

    void begin(const PlyElement& element, std::uint64_t entry) {
        element_ = &element;
        entry_ = entry;
    }
    void end() {}
    float number(const PlyProperty& property) {
        switch (property.type) {
            case PlyType::float32:
                return take<float>();
            case PlyType::float64:
                return static_cast<float>(take<double>());
            default:
                return static_cast<float>(integer(property.type, property));
        }
    }
    std::int64_t integer(PlyType type, const PlyProperty&) {
        switch (type) {
            case PlyType::int8:
                return take<std::int8_t>();
            case PlyType::uint8:
                return take<std::uint8_t>();
            case PlyType::int16:
                return take<std::int16_t>();
            case PlyType::uint16:
                return take<std::uint16_t>();
            case PlyType::uint32:
                return take<std::uint32_t>();
            default:
                return take<std::int32_t>();
        }
    }
    void require(std::uint64_t values, const PlyProperty& property) const {
        const std::uint64_t left = bytes_.size() - at_, needed = values * ply_type_bytes(property.type);
        if (needed > left)
            fail(fmt::format("{}: a list of {} bytes, found {} to the file's end", property.name, needed,
                             left));
    }
    double done() const { return static_cast<double>(at_) / static_cast<double>(bytes_.size()); }
    void finish() {
        if (bytes_.find_first_not_of(" \t\r\n", at_) != bytes_.npos)
            throw InvalidInput(fmt::format("{}: byte {}: expected the end of the file, found {} bytes more",
                                           file_, at_, bytes_.size() - at_));
    }
    [[noreturn]] void fail(const std::string& message) const {
        throw InvalidInput(fmt::format("{}: element {}, entry {}, byte {}: {}", file_,
                                       in_quotes(element_->name), entry_, value_at_, message));
    }

 private:
    template <class T>
    T take() {
        value_at_ = at_;
        if (bytes_.size() - at_ < sizeof(T)) fail("the file ends within this entry");
        const T value = load<T>(bytes_.data() + at_, swap_);
        at_ += sizeof(T);
        return value;
    }

    std::string_view bytes_;
    std::size_t at_;
    std::size_t value_at_ = 0;  // the latest value
    bool swap_;
    const std::string& file_;
    const PlyElement* element_ = nullptr;
    std::uint64_t entry_ = 0;
};

/// What three scalars in a row are together.
struct Vector {
    std::string name;
    float unit = 1;  // what their values are multiples of
};

/// red, green and blue of one type: of 8 or 16 bits, or floats.
std::optional<Vector> color_of(const PlyProperty* three) {
    constexpr const char* names[] = {"red", "green", "blue"};
    const PlyType type = three[0].type;
    for (std::size_t k = 0; k < 3; ++k)
        if (three[k].name != names[k] || three[k].list_count || three[k].type != type) return {};
    if (type == PlyType::uint8) return Vector{"color", 1.0f / 255};
    if (type == PlyType::uint16) return Vector{"color", 1.0f / 65535};
    if (type == PlyType::float32 || type == PlyType::float64) return Vector{"color"};
    return {};
}

/// The vector that three scalars in a row are: "a" for a_x, a_y, a_z; "normal" for nx, ny, nz; "color".
std::optional<Vector> vector_of(const std::vector<PlyProperty>& properties, std::size_t first) {
    if (first + 3 > properties.size()) return {};
    if (auto color = color_of(&properties[first])) return color;
    const std::string& x = properties[first].name;
    const bool normal = x == "nx";
    if (!normal && (x.size() < 3 || x.substr(x.size() - 2) != "_x")) return {};
    const std::string stem = normal ? "n" : x.substr(0, x.size() - 1);
    for (std::size_t k = 0; k < 3; ++k) {
        const PlyProperty& p = properties[first + k];
        if (p.list_count || p.name != stem + "xyz"[k]) return {};
    }
    return Vector{normal ? "normal" : x.substr(0, x.size() - 2)};
}

/// The scalars of an element's entries on their way to the properties of a mesh.
class Row {
 public:
    /// Makes the properties; `position`: whether x, y and z are the point and no properties.
    Row(const PlyElement& element, std::vector<MeshProperty>& properties, bool position)
        : values_(element.properties.size()), properties_(properties) {
        std::size_t rest_of_vector = 0;
        float unit = 1;
        for (std::size_t i = 0; i < element.properties.size(); ++i) {
            const PlyProperty& p = element.properties[i];
            const std::size_t axis =
                position && p.name.size() == 1 ? std::string_view("xyz").find(p.name[0]) : p.name.npos;
            if (p.list_count) continue;
            if (axis != p.name.npos) {
                axes_[axis] = i;
                continue;
            }
            if (rest_of_vector > 0) {
                --rest_of_vector;
            } else if (auto vector = vector_of(element.properties, i)) {
                properties_.push_back({std::move(vector->name), 3, {}});
                rest_of_vector = 2;
                unit = vector->unit;
            } else {
                properties_.push_back({p.name, 1, {}});
                unit = 1;
            }
            stored_.push_back({i, properties_.size() - 1, unit});
        }
        for (MeshProperty& p : properties_)
            p.values.reserve(element.count * static_cast<std::size_t>(p.components));
    }

    float& operator[](std::size_t i) { return values_[i]; }
    Vec3f point() const { return {values_[axes_[0]], values_[axes_[1]], values_[axes_[2]]}; }
    /// Appends this row to the properties.
    void store() {
        for (const Stored& s : stored_) {
            const float value = values_[s.value];
            properties_[s.property].values.push_back(s.unit == 1 ? value : value * s.unit);
        }
    }

 private:
    struct Stored {
        std::size_t value, property;  // of the element → of the mesh
        float unit;
    };

    std::vector<float> values_;  // by property of the element; those of lists are unused
    std::vector<MeshProperty>& properties_;
    std::array<std::size_t, 3> axes_{};
    std::vector<Stored> stored_;
};

template <class Body>
class Reader {
 public:
    Reader(const MappedFile& file, const PlyHeader& header, const Progress& progress)
        : header_(header), body_(file, header), progress_(progress) {}

    TriMesh read() {
        for (const PlyElement& element : header_.elements) {
            if (element.name == "vertex")
                vertices(element);
            else if (element.name == "face")
                faces(element);
            else
                for_each_entry(
                    element, [&](const PlyProperty& p, std::size_t) { skip(p); }, [] {});
        }
        body_.finish();
        return std::move(mesh_);
    }

 private:
    /// Calls value(property, its number) for each property and stored() after the last, for each entry.
    template <class Value, class Stored>
    void for_each_entry(const PlyElement& element, const Value& value, const Stored& stored) {
        for (std::uint64_t i = 0; i < element.count; ++i) {
            body_.begin(element, i);
            for (std::size_t k = 0; k < element.properties.size(); ++k) value(element.properties[k], k);
            body_.end();
            stored();
            if (i % report_every == 0) progress_.report(body_.done());
        }
    }

    std::uint64_t list_length(const PlyProperty& p) {
        const std::int64_t n = body_.integer(*p.list_count, p);
        if (n < 0) body_.fail(fmt::format("{}: a list of {} values", p.name, n));
        body_.require(static_cast<std::uint64_t>(n), p);
        return static_cast<std::uint64_t>(n);
    }

    void skip(const PlyProperty& p) {
        const std::uint64_t n = p.list_count ? list_length(p) : 1;
        for (std::uint64_t k = 0; k < n; ++k) body_.number(p);
    }

    void vertices(const PlyElement& element) {
        Row row(element, mesh_.vertex_properties, true);
        mesh_.points.reserve(element.count);
        for_each_entry(
            element,
            [&](const PlyProperty& p, std::size_t k) {
                if (p.list_count)
                    skip(p);
                else
                    row[k] = body_.number(p);
            },
            [&] {
                mesh_.points.push_back(row.point());
                row.store();
            });
    }

    void corners(const PlyProperty& p, std::uint64_t vertices) {
        // More corners than there are vertices can only be damage, but for small degenerate polygons.
        const std::uint64_t n = list_length(p), longest = std::max<std::uint64_t>(vertices, 255);
        if (n < 3 || n > longest)
            body_.fail(fmt::format("expected a face of 3 to {} corners, found {}", longest, n));
        polygon_.clear();
        for (std::uint64_t k = 0; k < n; ++k) {
            const std::int64_t v = body_.integer(p.type, p);
            if (v < 0 || static_cast<std::uint64_t>(v) >= vertices)
                body_.fail(fmt::format("a corner names vertex {} of {}", v, vertices));
            polygon_.push_back(static_cast<VertexId>(v));
        }
        append_fan(polygon_, mesh_.triangles);
    }

    void faces(const PlyElement& element) {
        Row row(element, mesh_.face_properties, false);
        const PlyProperty* const list = element.corners();
        const std::uint64_t vertices = header_.find("vertex")->count;
        mesh_.triangles.reserve(element.count);
        for_each_entry(
            element,
            [&](const PlyProperty& p, std::size_t k) {
                if (&p == list)
                    corners(p, vertices);
                else if (p.list_count)
                    skip(p);
                else
                    row[k] = body_.number(p);
            },
            [&] {
                for (std::size_t k = 2; k < polygon_.size(); ++k) row.store();
            });
    }

    const PlyHeader& header_;
    Body body_;
    const Progress& progress_;
    TriMesh mesh_;
    std::vector<VertexId> polygon_;
};

/// The names of the scalars that a property is written as.
std::vector<std::string> scalar_names(const MeshProperty& property) {
    const std::string& name = property.name;
    if (property.components == 1) return {name};
    if (is_color(property)) return {"red", "green", "blue"};
    if (property.components == 3 && name == "normal") return {"nx", "ny", "nz"};
    if (property.components == 3) return {name + "_x", name + "_y", name + "_z"};
    std::vector<std::string> names;
    for (int k = 0; k < property.components; ++k) names.push_back(fmt::format("{}_{}", name, k));
    return names;
}

/// The header's lines for these properties; `taken` are the names that the element has already.
std::string declare(const std::vector<MeshProperty>& properties, std::set<std::string> taken,
                    const std::string& file) {
    std::string lines;
    for (const MeshProperty& property : properties)
        for (const std::string& name : scalar_names(property)) {
            const bool printable =
                std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c <= '~'; });
            if (property.name.empty() || !printable)
                throw InvalidInput(fmt::format("{}: a property is called {}, which PLY cannot hold", file,
                                               in_quotes(property.name)));
            if (!taken.insert(name).second)
                throw InvalidInput(fmt::format("{}: two properties would be called '{}'", file, name));
            lines += fmt::format("property {} {}\n", is_color(property) ? "uchar" : "float", name);
        }
    return lines;
}

void put_properties(Buffer& buffer, const std::vector<MeshProperty>& properties, std::size_t element) {
    for (const MeshProperty& p : properties) {
        const std::size_t n = static_cast<std::size_t>(p.components);
        const float* const values = &p.values[element * n];
        for (std::size_t k = 0; k < n; ++k)
            if (is_color(p))
                put(buffer, color_byte(values[k]));
            else
                put(buffer, values[k]);
    }
}

}  // namespace

bool is_ply(std::string_view bytes) {
    return bytes.substr(0, 3) == "ply" && bytes.size() > 3 && std::string_view(" \t\r\n").find(bytes[3]) < 4;
}

TriMesh read_ply(const MappedFile& file, const Progress& progress) {
    const PlyHeader header = read_ply_header(file);
    if (header.encoding == PlyHeader::Encoding::ascii)
        return Reader<AsciiBody>(file, header, progress).read();
    return Reader<BinaryBody>(file, header, progress).read();
}

void write_ply(const TriMesh& mesh, const Output& out) {
    out.file.write(ply_header(mesh.points.size(), mesh.triangles.size(),
                              declare(mesh.vertex_properties, {"x", "y", "z"}, out.name),
                              declare(mesh.face_properties, {"vertex_indices", "vertex_index"}, out.name)));
    write_elements(out.file, mesh.points.size(), out.progress.part(0, 0.5),
                   [&](std::size_t i, Buffer& buffer) {
                       for (const float c : mesh.points[i]) put(buffer, c);
                       put_properties(buffer, mesh.vertex_properties, i);
                   });
    write_elements(out.file, mesh.triangles.size(), out.progress.part(0.5, 1),
                   [&](std::size_t i, Buffer& buffer) {
                       put(buffer, std::uint8_t(3));
                       for (const VertexId v : mesh.triangles[i]) put(buffer, v);
                       put_properties(buffer, mesh.face_properties, i);
                   });
}

}  // namespace vdbgeo::mesh_formats
