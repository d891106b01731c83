// Bytes → gzip, on all threads.
#pragma once

#include <cstddef>
#include <string>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// One gzip member (RFC 1952) that holds these bytes; level 0 stores them as they are, so that members of
/// equally many bytes have equally many.
std::string gzip_member(const void* data, std::size_t bytes, int level);

/// Compresses what is written into members of 1 MiB each, on all threads, and appends them to a file. gzip,
/// zlib and every reader of RFC 1952 take members one behind the other as one stream. The bytes do not depend
/// on the number of threads nor on how the data was cut into writes. 16 members are held in memory.
class GzipWriter {
 public:
    explicit GzipWriter(AtomicFile& file) : file_(file) {}
    void write(const void* data, std::size_t bytes);
    /// Writes what is left. Call it once, last.
    void finish() { write_members(); }

 private:
    void write_members();

    AtomicFile& file_;
    Array<char> pending_;
    std::size_t filled_ = 0;
};

}  // namespace vdbgeo
