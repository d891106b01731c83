#include "converters/byte_store.h"

#include <algorithm>
#include <cstring>

namespace vdbgeo {

void ByteStore::append(const void* data, std::size_t bytes) {
    const char* next = static_cast<const char*>(data);
    while (bytes > 0 && !file_) {
        const std::uint64_t inside = size_ % chunk;
        if (inside == 0) {
            if ((chunks_.size() + 1) * chunk > memory_) {
                file_.emplace(folder_);
                break;
            }
            chunks_.emplace_back(new char[chunk]);
        }
        const std::size_t n = std::min<std::uint64_t>(bytes, chunk - inside);
        std::memcpy(chunks_.back().get() + inside, next, n);
        next += n;
        bytes -= n;
        size_ += n;
    }
    if (bytes > 0) file_->append(next, bytes);
    size_ += bytes;
}

void ByteStore::read(std::uint64_t at, void* out, std::size_t bytes) const {
    char* next = static_cast<char*>(out);
    while (bytes > 0 && at < held()) {
        const std::size_t n = std::min<std::uint64_t>({bytes, chunk - at % chunk, held() - at});
        std::memcpy(next, chunks_[at / chunk].get() + at % chunk, n);
        next += n;
        at += n;
        bytes -= n;
    }
    if (bytes > 0) file_->read(at - held(), next, bytes);
}

}  // namespace vdbgeo
