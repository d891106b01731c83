// Bytes → gzip, bzip2, zstd.
#pragma once

#include <bzlib.h>
#include <zlib.h>
#include <zstd.h>

#include <stdexcept>
#include <string>

namespace vdbgeo::test {

inline std::string gzip(const std::string& bytes) {
    z_stream stream{};
    if (deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        throw std::runtime_error("gzip");
    std::string packed(deflateBound(&stream, bytes.size()) + 64, '\0'), input = bytes;
    stream.next_in = reinterpret_cast<Bytef*>(input.data());
    stream.avail_in = static_cast<uInt>(input.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    if (deflate(&stream, Z_FINISH) != Z_STREAM_END) throw std::runtime_error("gzip");
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
}

inline std::string bzip2(const std::string& bytes) {
    std::string packed(bytes.size() + bytes.size() / 100 + 600, '\0'), input = bytes;
    unsigned length = static_cast<unsigned>(packed.size());
    if (BZ2_bzBuffToBuffCompress(packed.data(), &length, input.data(), static_cast<unsigned>(input.size()), 9,
                                 0, 0) != BZ_OK)
        throw std::runtime_error("bzip2");
    packed.resize(length);
    return packed;
}

inline std::string zstd(const std::string& bytes) {
    std::string packed(ZSTD_compressBound(bytes.size()), '\0');
    packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3));
    return packed;
}

}  // namespace vdbgeo::test
