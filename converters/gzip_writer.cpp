#include "converters/gzip_writer.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <vector>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

constexpr std::size_t member_bytes = 1 << 20, batch_bytes = 16 * member_bytes;
constexpr int level = 4;  // higher ones save a thousandth of a map

}  // namespace

std::string gzip_member(const void* data, std::size_t bytes, int chosen_level) {
    z_stream stream{};
    // 16 more window bits ask for gzip's head and tail, which then have neither name nor time.
    if (deflateInit2(&stream, chosen_level, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        throw std::bad_alloc();
    std::string packed(deflateBound(&stream, static_cast<uLong>(bytes)), '\0');
    stream.next_in = static_cast<Bytef*>(const_cast<void*>(data));  // only read
    stream.avail_in = static_cast<uInt>(bytes);
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    const int result = deflate(&stream, Z_FINISH);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    if (result != Z_STREAM_END) throw std::bad_alloc();
    return packed;
}

void GzipWriter::write(const void* data, std::size_t bytes) {
    if (pending_.empty()) pending_.resize(batch_bytes);
    const char* from = static_cast<const char*>(data);
    while (bytes > 0) {
        const std::size_t n = std::min(bytes, batch_bytes - filled_);
        std::memcpy(pending_.data() + filled_, from, n);
        from += n, bytes -= n, filled_ += n;
        if (filled_ == batch_bytes) write_members();
    }
}

void GzipWriter::write_members() {
    std::vector<std::string> members((filled_ + member_bytes - 1) / member_bytes);
    parallel_for(members.size(), 1, [&](std::size_t m) {
        const std::size_t begin = m * member_bytes;
        members[m] = gzip_member(pending_.data() + begin, std::min(member_bytes, filled_ - begin), level);
    });
    for (const std::string& member : members) file_.write(member);
    filled_ = 0;
}

}  // namespace vdbgeo
