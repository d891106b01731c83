#include "converters/stored_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <vector>

#include "converters/mapped_file.h"
#include "converters/mesh_ply.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using mesh_formats::ply_type_bytes;
using mesh_formats::PlyElement;
using mesh_formats::PlyHeader;
using mesh_formats::PlyProperty;
using mesh_formats::PlyType;

/// Bytes before a property in an entry whose corners are three; nullptr: of a whole entry. Unset where an
/// entry has another list.
std::optional<std::size_t> bytes_before(const PlyElement& element, const PlyProperty* property) {
    std::size_t bytes = 0;
    for (const PlyProperty& p : element.properties) {
        if (&p == property) return bytes;
        if (p.list_count && &p != element.corners()) return {};
        bytes += p.list_count ? ply_type_bytes(*p.list_count) + 3 * ply_type_bytes(p.type)
                              : ply_type_bytes(p.type);
    }
    return bytes;
}

const PlyProperty* property_of(const PlyElement& element, const char* name) {
    for (const PlyProperty& p : element.properties)
        if (p.name == name) return &p;
    return nullptr;
}

class StoredPly : public StoredMesh {
 public:
    StoredPly(const std::filesystem::path& path, bool& fits)
        : file_(path), header_(mesh_formats::read_ply_header(file_)) {
        fits = find_places();
    }

    std::uint64_t vertices() const override { return vertices_; }
    std::uint64_t faces() const override { return faces_; }
    void read_faces(std::uint64_t first, std::size_t count, Triangle* triangles, char* caps) const override {
        std::vector<char> records(count * face_bytes_);
        file_.read_at(first_face_ + first * face_bytes_, records.data(), records.size());
        parallel_for(count, 4096, [&](std::size_t f) {
            const char* const record = records.data() + f * face_bytes_;
            if (static_cast<unsigned char>(record[corners_]) != 3)
                throw InvalidInput(fmt::format(
                    "{}: face {} has {} corners: only triangles can be measured part "
                    "by part; a larger --memory reads them all",
                    file_.name(), first + f, static_cast<int>(static_cast<unsigned char>(record[corners_]))));
            std::memcpy(triangles[f].data(), record + corners_ + 1, sizeof(Triangle));
            caps[f] = 0;
            if (!cap_) return;
            float cap = 0;
            std::memcpy(&cap, record + *cap_, sizeof cap);
            caps[f] = cap > 0.5f;
        });
    }
    Vec3f point(VertexId v) const override {
        Vec3f p;
        std::memcpy(p.data(), file_.bytes().data() + first_vertex_ + v * vertex_bytes_ + x_,
                    sizeof(float) * 3);
        return p;
    }
    void release() const override { file_.release(); }

 private:
    /// False where the file is of another kind.
    bool find_places() {
        const PlyElement *vertex = header_.find("vertex"), *face = header_.find("face");
        if (header_.encoding != PlyHeader::Encoding::little_endian || !face || !face->corners()) return false;
        // Nothing between them whose length only reading tells.
        if (header_.elements.size() != 2 || &header_.elements[0] != vertex) return false;
        const PlyProperty& corners = *face->corners();
        if (ply_type_bytes(*corners.list_count) != 1 || ply_type_bytes(corners.type) != 4) return false;
        const auto whole_vertex = bytes_before(*vertex, nullptr), whole_face = bytes_before(*face, nullptr);
        if (!whole_vertex || !whole_face) return false;
        const PlyProperty* x = property_of(*vertex, "x");
        const auto at = static_cast<std::size_t>(x - vertex->properties.data());
        for (std::size_t a = 0; a < 3; ++a) {
            if (at + a >= vertex->properties.size()) return false;
            const PlyProperty& p = vertex->properties[at + a];
            if (p.name != std::string(1, "xyz"[a]) || p.type != PlyType::float32) return false;
        }
        x_ = *bytes_before(*vertex, x);
        corners_ = *bytes_before(*face, &corners);
        if (const PlyProperty* cap = property_of(*face, cap_property)) {
            if (cap->type != PlyType::float32 || cap->list_count) return false;
            cap_ = bytes_before(*face, cap);
        }
        vertices_ = vertex->count;
        faces_ = face->count;
        vertex_bytes_ = *whole_vertex;
        face_bytes_ = *whole_face;
        first_vertex_ = header_.body;
        first_face_ = first_vertex_ + vertices_ * vertex_bytes_;
        return file_.bytes().size() - first_face_ >= faces_ * face_bytes_;
    }

    MappedFile file_;
    PlyHeader header_;
    std::uint64_t vertices_ = 0, faces_ = 0, first_vertex_ = 0, first_face_ = 0;
    std::size_t vertex_bytes_ = 0, face_bytes_ = 0, x_ = 0, corners_ = 0;
    std::optional<std::size_t> cap_;
};

}  // namespace

std::unique_ptr<StoredMesh> stored_ply(const std::filesystem::path& path) {
    bool fits = false;
    auto mesh = std::make_unique<StoredPly>(path, fits);
    return fits ? std::move(mesh) : nullptr;
}

}  // namespace vdbgeo
