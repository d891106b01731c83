#include "converters/gmsh_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "vdbgeo/core/errors.h"

namespace vdbgeo::tet_formats {

GmshSource::GmshSource(const MappedFile& file) : bytes_(file.bytes()), text_(bytes_, file.name()) {
    const std::string_view first = text_.next_word();
    if (first != "$MeshFormat")
        fail(fmt::format("no file of Gmsh: expected $MeshFormat, found {}", in_quotes(first)));
    version_ = text_.real_in(text_.next_word(), "version");
    if (!(version_ >= 2 && version_ < 3) && version_ != 4.1)
        fail(fmt::format("files of version {} are not read: expected 2 or 4.1", version_));
    const std::int64_t type = word_integer(text_.next_word(), "type of the file"),
                       bytes = word_integer(text_.next_word(), "data size");
    if (type != 0 && type != 1) fail(fmt::format("type of the file: expected 0 or 1, found {}", type));
    if (bytes != 8 && (bytes != 4 || version_ < 4))
        fail(fmt::format("data size: expected 8{}, found {}", version_ < 4 ? "" : " or 4", bytes));
    size_bytes_ = static_cast<std::uint64_t>(bytes);
    if (type == 1) {
        at_ = text_.offset();
        binary_ = true;
        end_line();
        const auto one = take<std::int32_t>("the number 1");
        swap_ = one != 1;
        if (one != 1 && one != 1 << 24) fail("expected the number 1 in 4 bytes");
    }
    end_section("MeshFormat");
}

double GmshSource::fraction() const {
    return static_cast<double>(binary_ ? at_ : text_.offset()) / static_cast<double>(bytes_.size());
}

std::string_view GmshSource::section() {
    const std::string_view word = line_word();
    if (!word.empty() && word[0] != '$')
        fail(fmt::format("expected a section such as $Nodes, found {}", in_quotes(word)));
    return word.substr(word.empty() ? 0 : 1);
}

void GmshSource::end_section(std::string_view name) {
    const std::string_view word = line_word();
    if (word.substr(0, 4) != "$End" || word.substr(4) != name)
        fail(fmt::format("expected $End{}, found {}", name, in_quotes(word)));
}

void GmshSource::pass_over_section(std::string_view name) {
    const std::string end = fmt::format("$End{}", name);
    if (binary_) {
        at_ = std::min(bytes_.find(end, at_), bytes_.size());
        return end_section(name);
    }
    while (text_.next_line())
        if (text_.word() == end) return;
    fail(fmt::format("the file ends before {}", in_quotes(end)));
}

void GmshSource::pass_over(std::uint64_t values, std::uint64_t bytes, const char* what) {
    need_room(values, 1, bytes, what);
    if (binary_) {
        at_ += values * bytes;
        return;
    }
    for (std::uint64_t i = 0; i < values; ++i)
        if (text_.next_word().empty()) fail(fmt::format("{}: the file ends", what));
}

void GmshSource::need_room(std::uint64_t entries, std::uint64_t values, std::uint64_t bytes,
                           const char* what) const {
    // in text a digit and a blank at least; the last blank may be missing
    const std::uint64_t left = binary_ ? bytes_.size() - at_ : text_.remaining() + 1;
    const std::uint64_t each = binary_ ? bytes : 2;
    if (entries > 0 && values > 0 && (values > left || entries > left / (values * each)))
        fail(fmt::format("{}: {} entries of {} numbers, found {} bytes", what, entries, values, left));
}

void GmshSource::fail(const std::string& message) const {
    if (!binary_) text_.fail(message);
    throw InvalidInput(fmt::format("{}: byte {}: {}", text_.file(), at_, message));
}

/// Goes behind the end of this line of a binary file.
void GmshSource::end_line() { at_ = std::min(bytes_.find('\n', at_), bytes_.size() - 1) + 1; }

/// The first word of the next line that has one; in a binary file this line is then behind.
std::string_view GmshSource::line_word() {
    if (!binary_) return text_.next_word();
    at_ = std::min(bytes_.find_first_not_of(" \t\r\n", at_), bytes_.size());
    if (at_ == bytes_.size()) return {};
    const std::size_t first = at_;
    end_line();
    const std::string_view line = bytes_.substr(first, at_ - first);
    return line.substr(0, line.find_first_of(" \t\r\n"));
}

std::int64_t GmshSource::word_integer(std::string_view word, const char* what) const {
    if (word.empty()) fail(fmt::format("{}: the file ends", what));
    return text_.integer_in(word, what);
}

std::int32_t GmshSource::text_integer(const char* what) {
    const std::int64_t value = word_integer(text_.next_word(), what);
    if (value != static_cast<std::int32_t>(value))
        fail(fmt::format("{}: {} has more than 32 bits", what, value));
    return static_cast<std::int32_t>(value);
}

std::uint64_t GmshSource::count(std::int64_t value, const char* what) const {
    if (value < 0) fail(fmt::format("{}: expected a count, found {}", what, value));
    return static_cast<std::uint64_t>(value);
}

}  // namespace vdbgeo::tet_formats
