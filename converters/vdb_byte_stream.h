// Bytes of a VDB file as OpenVDB takes them.
#pragma once

#include <openvdb/io/io.h>

#include <istream>
#include <streambuf>
#include <string_view>

#include "converters/vdb_skeleton.h"

namespace vdbgeo {

/// A stream over bytes in memory that knows what OpenVDB wants to know of a file.
class VdbByteStream : public std::istream {
 public:
    VdbByteStream(const VdbSkeleton& skeleton, const VdbEntry& entry, std::string_view bytes)
        : std::istream(nullptr), buffer_(bytes) {
        rdbuf(&buffer_);
        namespace io = openvdb::io;
        io::setVersion(*this, {skeleton.release_major, skeleton.release_minor}, skeleton.version);
        io::setDataCompression(*this, entry.compression);
    }

    /// Begins anew with other bytes.
    void restart(std::string_view bytes) {
        clear();
        buffer_.set(bytes);
    }
    /// Bytes read so far.
    std::uint64_t position() const { return buffer_.position(); }

 private:
    struct Buffer : std::streambuf {
        std::uint64_t position() const { return static_cast<std::uint64_t>(gptr() - eback()); }
        explicit Buffer(std::string_view bytes) { set(bytes); }
        void set(std::string_view bytes) {
            char* begin = const_cast<char*>(bytes.data());  // never written to: there is no put area
            setg(begin, begin, begin + bytes.size());
        }
    } buffer_;
};

}  // namespace vdbgeo
