// Gmsh's mesh files as sections, and numbers within them as text or as bytes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "converters/mapped_file.h"
#include "converters/mesh_formats.h"
#include "converters/text_cursor.h"

namespace vdbgeo::tet_formats {

/// A position in a file of version 2 or 4.1. Every failure throws InvalidInput "FILE: line N: …", in binary
/// files "FILE: byte N: …".
class GmshSource {
 public:
    /// Reads the section MeshFormat.
    explicit GmshSource(const MappedFile& file);

    double version() const { return version_; }
    bool binary() const { return binary_; }
    /// Bytes of what Gmsh has as size_t.
    std::uint64_t size_bytes() const { return size_bytes_; }
    /// Which part of the file is behind.
    double fraction() const;

    /// The next section's name; empty at the end of the file.
    std::string_view section();
    void end_section(std::string_view name);
    void pass_over_section(std::string_view name);

    /// A count in a line of its own, which is text in binary files as well.
    std::uint64_t count_line(const char* what) { return count(word_integer(line_word(), what), what); }
    std::int32_t integer(const char* what) { return binary_ ? take<std::int32_t>(what) : text_integer(what); }
    std::uint64_t size(const char* what) {
        if (!binary_) return count(word_integer(text_.next_word(), what), what);
        return size_bytes_ == 8 ? take<std::uint64_t>(what) : take<std::uint32_t>(what);
    }
    double real(const char* what) {
        return binary_ ? take<double>(what) : text_.real_in(text_.next_word(), what);
    }
    /// Passes over `values` numbers, `bytes` each in binary files.
    void pass_over(std::uint64_t values, std::uint64_t bytes, const char* what);
    /// Fails unless the file is long enough for `entries` of `values` numbers of `bytes` each.
    void need_room(std::uint64_t entries, std::uint64_t values, std::uint64_t bytes, const char* what) const;

    [[noreturn]] void fail(const std::string& message) const;

 private:
    void end_line();
    std::string_view line_word();
    std::int64_t word_integer(std::string_view word, const char* what) const;
    std::int32_t text_integer(const char* what);
    std::uint64_t count(std::int64_t value, const char* what) const;
    template <class T>
    T take(const char* what) {
        if (bytes_.size() - at_ < sizeof(T)) fail(std::string(what) + ": the file ends");
        const T value = mesh_formats::load<T>(bytes_.data() + at_, swap_);
        at_ += sizeof(T);
        return value;
    }

    std::string_view bytes_;
    TextCursor text_;
    std::size_t at_ = 0;  // in binary files; in others text_ knows
    double version_ = 0;
    bool binary_ = false, swap_ = false;
    std::uint64_t size_bytes_ = 8;
};

}  // namespace vdbgeo::tet_formats
