#include "converters/vtk_arrays.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <type_traits>

#include "converters/mesh_formats.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

constexpr std::string_view blanks = " \t\r\n";

std::string unescaped(std::string_view text) {
    constexpr std::pair<std::string_view, char> entities[] = {
        {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}, {"&amp;", '&'}};
    std::string out;
    while (!text.empty()) {
        std::size_t used = 1;
        char c = text[0];
        for (const auto& [entity, meant] : entities)
            if (text.substr(0, entity.size()) == entity) {
                c = meant;
                used = entity.size();
            }
        out += c;
        text.remove_prefix(used);
    }
    return out;
}

/// The bytes that base64 text stands for. Streams that follow one another, each padded at its end, read as
/// one.
class Base64 {
 public:
    explicit Base64(std::string_view text) : text_(text) {}

    /// At most `count` bytes more: fewer where the text ends.
    std::string take(std::uint64_t count) {
        std::string out;
        out.reserve(std::min<std::uint64_t>(count, left()));
        while (out.size() < count && fill()) {
            const std::size_t n = std::min<std::uint64_t>(count - out.size(), ready_);
            out.append(quad_.data() + used_, n);
            used_ += n;
            ready_ -= n;
        }
        return out;
    }
    /// The most bytes that can follow.
    std::uint64_t left() const { return ready_ + text_.size() / 4 * 3 + 3; }

 private:
    static int value(char c) {
        if (c >= 'A' && c <= 'Z') return c - 'A';
        if (c >= 'a' && c <= 'z') return c - 'a' + 26;
        if (c >= '0' && c <= '9') return c - '0' + 52;
        return c == '+' ? 62 : c == '/' ? 63 : -1;
    }

    /// Whether there is a byte; decodes the next four characters where the last ones are used up.
    bool fill() {
        if (ready_ > 0) return true;
        std::uint32_t bits = 0;
        std::size_t digits = 0, seen = 0;
        while (seen < 4) {
            if (text_.empty()) return false;
            const char c = text_[0];
            const int v = value(c);
            if (v < 0 && c != '=' && blanks.find(c) == blanks.npos) return false;
            text_.remove_prefix(1);
            if (v < 0 && c != '=') continue;
            ++seen;
            bits = bits << 6 | static_cast<std::uint32_t>(std::max(v, 0));
            if (v >= 0) digits = seen;
        }
        quad_ = {static_cast<char>(bits >> 16), static_cast<char>(bits >> 8), static_cast<char>(bits)};
        used_ = 0;
        ready_ = digits * 3 / 4;
        return ready_ > 0;
    }

    std::string_view text_;
    std::array<char, 3> quad_{};
    std::size_t used_ = 0, ready_ = 0;
};

/// Bytes that stand in the file as they are.
class Raw {
 public:
    explicit Raw(std::string_view bytes) : bytes_(bytes) {}
    std::string_view take(std::uint64_t count) {
        const std::string_view out = bytes_.substr(0, count);
        bytes_.remove_prefix(out.size());
        return out;
    }
    std::uint64_t left() const { return bytes_.size(); }

 private:
    std::string_view bytes_;
};

class Decoder {
 public:
    Decoder(const VtkArray& array, const VtkEncoding& encoding, std::optional<std::uint64_t> expected,
            const std::string& file)
        : array_(array), encoding_(encoding), expected_(expected), file_(file) {}

    /// The numbers of a text, in the bytes of this host.
    std::string text() const {
        std::string out;
        std::string_view text = array_.text;
        for (;;) {
            text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
            if (text.empty()) break;
            const std::string_view word = text.substr(0, text.find_first_of(blanks));
            if (array_.type.kind == 'f' && array_.type.bytes == 4)
                append<float>(word, out);
            else if (array_.type.kind == 'f')
                append<double>(word, out);
            else if (array_.type.kind == 'i')
                append<std::int64_t>(word, out);
            else
                append<std::uint64_t>(word, out);
            text.remove_prefix(word.size());
        }
        const std::size_t each = array_.type.kind == 'f' ? array_.type.bytes : 8;
        if (expected_ && out.size() / each != *expected_)
            fail(fmt::format("expected {} values, found {}", *expected_, out.size() / each));
        return out;
    }

    template <class Source>
    auto plain(Source source) const {
        const bool told = encoding_.header_bytes > 0;
        const std::uint64_t bytes = told ? words(source, 1)[0] : expected_.value_or(0) * array_.type.bytes;
        check_bytes(bytes);
        if (bytes > source.left()) fail(fmt::format("{} bytes, found {}", bytes, source.left()));
        auto values = source.take(bytes);
        if (values.size() < bytes) fail(fmt::format("{} bytes, found {}", bytes, values.size()));
        return values;
    }

    template <class Source>
    std::string zlib(Source source) const {
        const std::uint64_t blocks = words(source, 1)[0];
        if (blocks > source.left() / encoding_.header_bytes)
            fail(fmt::format("{} blocks, which is too many", blocks));
        const auto sizes = words(source, 2);
        const auto packed = words(source, blocks);
        if (blocks == 0) {
            check_bytes(0);
            return {};
        }
        // zlib packs no better than 1 to 1032.
        const std::uint64_t block = sizes[0], last = sizes[1] > 0 ? sizes[1] : block,
                            most = source.left() * 1032 + 64;
        if (last > most || last > block || (blocks > 1 && block > 0 && (most - last) / block < blocks - 1))
            fail(
                fmt::format("{} blocks of {} bytes do not come from {} bytes", blocks, block, source.left()));
        check_bytes(block * (blocks - 1) + last);
        std::string out(block * (blocks - 1) + last, '\0');
        for (std::uint64_t b = 0; b < blocks; ++b) {
            if (packed[b] > source.left())
                fail(fmt::format("block {} has {} bytes, found {}", b, packed[b], source.left()));
            const auto bytes = source.take(packed[b]);
            const std::uint64_t wanted = b + 1 < blocks ? block : last;
            uLongf size = wanted;
            const int code = ::uncompress(reinterpret_cast<Bytef*>(out.data() + b * block), &size,
                                          reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
            if (code != Z_OK || size != wanted) fail(fmt::format("block {} is damaged", b));
        }
        return out;
    }

    [[noreturn]] void fail(const std::string& message) const {
        throw InvalidInput(fmt::format("{}: array {}: {}", file_, in_quotes(array_.name), message));
    }

 private:
    template <class T>
    void append(std::string_view word, std::string& out) const {
        T value{};
        std::string_view digits = word;
        if (digits.substr(0, 1) == "+") digits.remove_prefix(1);
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        // Out of range of a float: too small, and 0 is nearest, or too large, and infinity is, which no mesh
        // has.
        const bool range = error == std::errc::result_out_of_range && array_.type.kind == 'f';
        if constexpr (std::is_floating_point_v<T>)
            if (range) value = static_cast<T>(std::strtod(std::string(digits).c_str(), nullptr));
        if ((error != std::errc() && !range) || end != digits.data() + digits.size())
            fail(fmt::format("expected a number, found {}", in_quotes(word)));
        char bytes[sizeof(T)];
        std::memcpy(bytes, &value, sizeof value);
        out.append(bytes, sizeof value);
    }

    template <class Source>
    std::vector<std::uint64_t> words(Source& source, std::uint64_t count) const {
        const auto bytes = source.take(count * encoding_.header_bytes);
        if (bytes.size() < count * encoding_.header_bytes) fail("the file ends within it");
        const bool swap = encoding_.big_endian != host_is_big_endian;
        std::vector<std::uint64_t> out(count);
        for (std::uint64_t i = 0; i < count; ++i) {
            const char* const at = bytes.data() + i * encoding_.header_bytes;
            out[i] =
                encoding_.header_bytes == 8 ? load<std::uint64_t>(at, swap) : load<std::uint32_t>(at, swap);
        }
        return out;
    }

    void check_bytes(std::uint64_t bytes) const {
        const std::uint64_t each = array_.type.bytes;
        if (bytes % each != 0) fail(fmt::format("{} bytes are no whole number of values of {}", bytes, each));
        if (expected_ && bytes / each != *expected_)
            fail(fmt::format("expected {} values, found {}", *expected_, bytes / each));
    }

    const VtkArray& array_;
    const VtkEncoding& encoding_;
    std::optional<std::uint64_t> expected_;
    const std::string& file_;
};

}  // namespace

std::optional<XmlTag> next_tag(std::string_view text, std::size_t from) {
    for (std::size_t open = text.find('<', from); open != text.npos; open = text.find('<', open)) {
        const std::string_view rest = text.substr(open);
        const char* const until = rest.substr(0, 4) == "<!--" ? "-->"
                                  : rest.substr(0, 2) == "<?" ? "?>"
                                                              : nullptr;
        if (until) {
            open = text.find(until, open);
            if (open == text.npos) return {};
            continue;
        }
        char quote = '\0';
        std::size_t close = open + 1;
        for (; close < text.size() && (quote != '\0' || text[close] != '>'); ++close) {
            const char c = text[close];
            if (quote == '\0' && (c == '"' || c == '\''))
                quote = c;
            else if (c == quote)
                quote = '\0';
        }
        if (close == text.size()) return {};
        XmlTag tag;
        tag.begin = open;
        tag.end = close + 1;
        std::string_view inside = text.substr(open + 1, close - open - 1);
        tag.closing = !inside.empty() && inside.front() == '/';
        if (tag.closing) inside.remove_prefix(1);
        tag.empty = !inside.empty() && inside.back() == '/';
        if (tag.empty) inside.remove_suffix(1);
        tag.name = inside.substr(0, inside.find_first_of(blanks));
        tag.attributes = inside.substr(tag.name.size());
        return tag;
    }
    return {};
}

std::optional<std::string> XmlTag::attribute(std::string_view wanted) const {
    std::string_view rest = attributes;
    for (;;) {
        rest.remove_prefix(std::min(rest.find_first_not_of(blanks), rest.size()));
        const std::size_t equals = rest.find('=');
        if (equals == rest.npos) return {};
        std::string_view own = rest.substr(0, equals);
        own = own.substr(0, own.find_last_not_of(blanks) + 1);
        const std::size_t open = rest.find_first_of("\"'", equals);
        if (open == rest.npos) return {};
        const std::size_t close = rest.find(rest[open], open + 1);
        if (close == rest.npos) return {};
        if (own == wanted) return unescaped(rest.substr(open + 1, close - open - 1));
        rest.remove_prefix(close + 1);
    }
}

std::optional<VtkType> vtk_type(std::string_view name) {
    constexpr std::pair<std::string_view, VtkType> types[] = {
        {"Int8", {'i', 1}},    {"UInt8", {'u', 1}},  {"Int16", {'i', 2}}, {"UInt16", {'u', 2}},
        {"Int32", {'i', 4}},   {"UInt32", {'u', 4}}, {"Int64", {'i', 8}}, {"UInt64", {'u', 8}},
        {"Float32", {'f', 4}}, {"Float64", {'f', 8}}};
    for (const auto& [known, type] : types)
        if (name == known) return type;
    return {};
}

double VtkValues::real(std::uint64_t i) const {
    const char* const at = data() + i * type_.bytes;
    if (type_.kind == 'f') return type_.bytes == 4 ? double(load<float>(at, swap_)) : load<double>(at, swap_);
    if (type_.kind == 'u' && type_.bytes == 8) return static_cast<double>(load<std::uint64_t>(at, swap_));
    return static_cast<double>(integer(i));
}

float VtkValues::number(std::uint64_t i) const {
    const char* const at = data() + i * type_.bytes;
    if (type_.kind == 'f') return static_cast<float>(real(i));
    if (type_.kind == 'u' && type_.bytes == 8) return static_cast<float>(load<std::uint64_t>(at, swap_));
    return static_cast<float>(integer(i));
}

std::int64_t VtkValues::integer(std::uint64_t i) const {
    const char* const at = data() + i * type_.bytes;
    const bool sign = type_.kind == 'i';
    if (type_.kind == 'f') {
        const double v = type_.bytes == 4 ? double(load<float>(at, swap_)) : load<double>(at, swap_);
        return v > -9e18 && v < 9e18 ? static_cast<std::int64_t>(v)
                                     : std::numeric_limits<std::int64_t>::min();
    }
    switch (type_.bytes) {
        case 1:
            return sign ? load<std::int8_t>(at, swap_) : load<std::uint8_t>(at, swap_);
        case 2:
            return sign ? load<std::int16_t>(at, swap_) : load<std::uint16_t>(at, swap_);
        case 4:
            return sign ? load<std::int32_t>(at, swap_) : std::int64_t(load<std::uint32_t>(at, swap_));
        default:
            return load<std::int64_t>(at, swap_);  // beyond 2^63 negative: the lowest or near it
    }
}

VtkValues vtk_values(const VtkArray& array, const VtkEncoding& encoding,
                     std::optional<std::uint64_t> expected, const std::string& file) {
    const Decoder decoder(array, encoding, expected, file);
    VtkValues values;
    values.type_ = array.type;
    values.swap_ = encoding.big_endian != host_is_big_endian;
    if (array.format == "ascii") {
        values.owned_ = decoder.text();
        values.swap_ = false;
        if (array.type.kind != 'f') values.type_.bytes = 8;
    } else if (array.format == "binary") {
        values.owned_ = encoding.zlib ? decoder.zlib(Base64(array.text)) : decoder.plain(Base64(array.text));
    } else if (array.format == "appended") {
        if (array.offset > encoding.appended.size())
            decoder.fail(fmt::format("begins at byte {} of {} that are appended", array.offset,
                                     encoding.appended.size()));
        const std::string_view from = encoding.appended.substr(array.offset);
        if (encoding.appended_base64)
            values.owned_ = encoding.zlib ? decoder.zlib(Base64(from)) : decoder.plain(Base64(from));
        else if (encoding.zlib)
            values.owned_ = decoder.zlib(Raw(from));
        else
            values.bytes_ = decoder.plain(Raw(from));
    } else {
        decoder.fail(
            fmt::format("expected the format ascii, binary or appended, found {}", in_quotes(array.format)));
    }
    values.size_ =
        (values.owned_.empty() ? values.bytes_ : std::string_view(values.owned_)).size() / values.type_.bytes;
    return values;
}

}  // namespace vdbgeo::mesh_formats
