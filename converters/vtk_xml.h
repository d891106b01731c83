// VTK's XML files as a whole: finding the pieces and arrays of one, and writing one.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "converters/mesh_formats.h"
#include "converters/vtk_piece.h"

namespace vdbgeo::mesh_formats {

/// What a file declares. Everything in it points into the file's bytes.
struct VtkFile {
    bool poly_data = true;  ///< or an unstructured grid
    VtkEncoding encoding;
    std::vector<VtkPiece> pieces;
};

/// Takes a file of PolyData or an UnstructuredGrid apart; no array is decoded. Throws InvalidInput "FILE: …".
VtkFile scan_vtk_xml(const MappedFile& file);

/// Writes a file of one piece: arrays are declared, section after section, and then written behind the
/// declarations, raw and little-endian.
class VtkWriter {
 public:
    /// `type`: PolyData or UnstructuredGrid; `counts`: the attributes of the piece.
    VtkWriter(AtomicFile& file, std::string type, const std::string& counts);

    void begin(const std::string& section, const std::string& attributes = "");
    void end(const std::string& section) { text_ += "</" + section + ">\n"; }

    /// Declares an array of `count` elements of `bytes` each; append(i, buffer) adds those of element i when
    /// write() asks for them.
    template <class Append>
    void array(const char* type, const std::string& name, int components, std::size_t count,
               std::size_t bytes, Append append) {
        declare(type, name, components, static_cast<std::uint64_t>(count) * bytes);
        values_.push_back([this, count, append = std::move(append)](const Progress& progress) {
            write_elements(file_, count, progress, append);
        });
        lengths_.push_back(static_cast<std::uint64_t>(count) * bytes);
    }
    /// Floats of a property, declared as Float32.
    void property(const MeshProperty& property);

    /// Writes everything. Call it once, last.
    void write(const Progress& progress);

 private:
    void declare(const char* type, const std::string& name, int components, std::uint64_t bytes);

    AtomicFile& file_;
    std::string type_, text_;
    std::vector<std::function<void(const Progress&)>> values_;
    std::vector<std::uint64_t> lengths_;
    std::uint64_t offset_ = 0;
};

}  // namespace vdbgeo::mesh_formats
