#include "converters/byte_source.h"

#include <bzlib.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

constexpr std::size_t input_bytes = 1 << 16;
constexpr std::size_t peek_bytes = 10;
constexpr std::uint64_t unknown = std::numeric_limits<std::uint64_t>::max();

/// The bytes of the file itself. The first few can be looked at before they are read, on a pipe too.
class RawFile {
 public:
    explicit RawFile(const std::filesystem::path& path) : name_(path.string()) {
        if (name_ == "-") {
            name_ = "standard input";
            fd_ = ::dup(STDIN_FILENO);
        } else {
            fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
        }
        if (fd_ < 0) fail("cannot be opened", errno);
        struct stat status {};
        if (::fstat(fd_, &status) != 0) fail("cannot be read", errno);
        if (S_ISDIR(status.st_mode)) {
            ::close(fd_);
            throw IoError(fmt::format("{}: is a directory, expected a file", name_));
        }
        const off_t here = S_ISREG(status.st_mode) ? ::lseek(fd_, 0, SEEK_CUR) : off_t(-1);
        if (here >= 0) size_ = static_cast<std::uint64_t>(std::max<off_t>(status.st_size - here, 0));
        from_start_ = here == 0;
        while (peeked_ < peek_bytes) {
            const std::size_t n = read_fd(peek_.data() + peeked_, peek_bytes - peeked_);
            if (n == 0) break;
            peeked_ += n;
        }
    }
    ~RawFile() {
        if (fd_ >= 0) ::close(fd_);
    }
    RawFile(const RawFile&) = delete;
    RawFile& operator=(const RawFile&) = delete;

    std::size_t read(void* out, std::size_t bytes) {
        if (taken_ < peeked_) {
            const std::size_t n = std::min(bytes, peeked_ - taken_);
            std::memcpy(out, peek_.data() + taken_, n);
            taken_ += n;
            return n;
        }
        return read_fd(out, bytes);
    }

    /// Moves on without reading; returns by how much (0 where the file is a pipe).
    std::uint64_t seek_past(std::uint64_t position, std::uint64_t bytes) {
        if (!size_ || taken_ < peeked_) return 0;
        const std::uint64_t step = std::min(bytes, *size_ - std::min(position, *size_));
        if (::lseek(fd_, static_cast<off_t>(step), SEEK_CUR) < 0) fail("cannot be read", errno);
        return step;
    }

    bool starts_with(std::initializer_list<unsigned char> magic) const {
        return peeked_ >= magic.size() && std::equal(magic.begin(), magic.end(), peek_.begin());
    }
    unsigned char peek(std::size_t i) const { return i < peeked_ ? peek_[i] : 0; }
    const std::string& name() const { return name_; }
    std::optional<std::uint64_t> size() const { return size_; }
    int descriptor() const { return from_start_ ? fd_ : -1; }

 private:
    std::size_t read_fd(void* out, std::size_t bytes) {
        for (;;) {
            const ssize_t n = ::read(fd_, out, std::min<std::size_t>(bytes, 1 << 30));
            if (n >= 0) return static_cast<std::size_t>(n);
            if (errno != EINTR) fail("reading failed", errno);
        }
    }
    [[noreturn]] void fail(const char* doing, int error) {
        if (fd_ >= 0) ::close(std::exchange(fd_, -1));
        throw IoError(fmt::format("{}: {}: {}", name_, doing, std::strerror(error)));
    }

    std::string name_;
    int fd_ = -1;
    std::optional<std::uint64_t> size_;
    std::array<unsigned char, peek_bytes> peek_{};
    std::size_t peeked_ = 0, taken_ = 0;
    bool from_start_ = false;  // a regular file, opened at its beginning
};

class PlainSource : public ByteSource {
 public:
    explicit PlainSource(std::unique_ptr<RawFile> file)
        : ByteSource(file->name(), ""), file_(std::move(file)) {}
    std::optional<std::uint64_t> length() const override { return file_->size(); }
    std::uint64_t length_bound() const override { return file_->size().value_or(unknown); }
    int descriptor() const override { return file_->descriptor(); }

 protected:
    std::size_t read_some(void* out, std::size_t bytes) override { return file_->read(out, bytes); }
    std::uint64_t seek_past(std::uint64_t bytes) override { return file_->seek_past(position(), bytes); }

 private:
    std::unique_ptr<RawFile> file_;
};

/// What the three kinds of compression share: a buffer of packed bytes, and their largest possible gain.
class PackedSource : public ByteSource {
 public:
    std::uint64_t length_bound() const override {
        std::uint64_t bound = 0;
        if (!file_->size() || __builtin_mul_overflow(*file_->size(), gain_, &bound)) return unknown;
        return bound;
    }

 protected:
    PackedSource(std::unique_ptr<RawFile> file, const char* compression, std::uint64_t gain)
        : ByteSource(file->name(), compression), file_(std::move(file)), gain_(gain), input_(input_bytes) {}

    /// Sees to it that there is input; false at the end of the file.
    bool refill() {
        if (next_ < filled_) return true;
        next_ = 0;
        filled_ = file_->read(input_.data(), input_.size());
        packed_ += filled_;
        return filled_ > 0;
    }
    /// Sees to it that `count` bytes of input are there in one piece, as far as the file has them.
    std::size_t gather(std::size_t count) {
        std::memmove(input_.data(), input_.data() + next_, filled_ - next_);
        filled_ -= next_;
        next_ = 0;
        while (filled_ < count) {
            const std::size_t n = file_->read(input_.data() + filled_, input_.size() - filled_);
            if (n == 0) break;
            filled_ += n;
            packed_ += n;
        }
        return std::min(count, filled_);
    }
    [[noreturn]] void damaged(const char* reason) const {
        throw InvalidInput(fmt::format("{}: the {} data is damaged near byte {} ({} bytes were unpacked): {}",
                                       name(), compression(), packed_ - (filled_ - next_), position(),
                                       reason));
    }

    std::unique_ptr<RawFile> file_;
    std::uint64_t gain_;
    std::vector<unsigned char> input_;
    std::size_t next_ = 0, filled_ = 0;
    std::uint64_t packed_ = 0;  // bytes taken from the file
    bool ended_ = false;
};

class GzipSource : public PackedSource {
 public:
    explicit GzipSource(std::unique_ptr<RawFile> file) : PackedSource(std::move(file), "gzip", 1033) {
        if (inflateInit2(&stream_, 15 + 16) != Z_OK) throw IoError(name() + ": no memory for unpacking");
    }
    ~GzipSource() override { inflateEnd(&stream_); }

 protected:
    std::size_t read_some(void* out, std::size_t bytes) override {
        const uInt room = static_cast<uInt>(std::min<std::size_t>(bytes, 1 << 30));
        stream_.next_out = static_cast<Bytef*>(out);
        stream_.avail_out = room;
        while (!ended_ && stream_.avail_out == room) {
            if (!refill()) return cut_off_ = true, ended_ = true, 0;
            stream_.next_in = input_.data() + next_;
            stream_.avail_in = static_cast<uInt>(filled_ - next_);
            const int result = inflate(&stream_, Z_NO_FLUSH);
            next_ = filled_ - stream_.avail_in;
            if (result == Z_STREAM_END) {  // another member may follow; what is no member is padding
                const bool more = gather(3) == 3 && input_[0] == 0x1f && input_[1] == 0x8b && input_[2] == 8;
                ended_ = !more || inflateReset(&stream_) != Z_OK;
            } else if (result != Z_OK && result != Z_BUF_ERROR) {
                damaged(stream_.msg ? stream_.msg : "not gzip data");
            }
        }
        return room - stream_.avail_out;
    }

 private:
    z_stream stream_{};
};

class Bzip2Source : public PackedSource {
 public:
    // A block of 900 kB holds at most 259 bytes for every 5 and takes at least some 25 bytes.
    explicit Bzip2Source(std::unique_ptr<RawFile> file) : PackedSource(std::move(file), "bzip2", 2000000) {
        start();
    }
    ~Bzip2Source() override { BZ2_bzDecompressEnd(&stream_); }

 protected:
    std::size_t read_some(void* out, std::size_t bytes) override {
        const unsigned room = static_cast<unsigned>(std::min<std::size_t>(bytes, 1 << 30));
        stream_.next_out = static_cast<char*>(out);
        stream_.avail_out = room;
        while (!ended_ && stream_.avail_out == room) {
            if (!refill()) return cut_off_ = true, ended_ = true, 0;
            stream_.next_in = reinterpret_cast<char*>(input_.data() + next_);
            stream_.avail_in = static_cast<unsigned>(filled_ - next_);
            const int result = BZ2_bzDecompress(&stream_);
            next_ = filled_ - stream_.avail_in;
            if (result == BZ_STREAM_END) {
                ended_ = gather(3) < 3 || std::memcmp(input_.data(), "BZh", 3) != 0;
                if (!ended_) {
                    const auto rest = stream_;
                    BZ2_bzDecompressEnd(&stream_);
                    start();
                    stream_.next_out = rest.next_out;
                    stream_.avail_out = rest.avail_out;
                }
            } else if (result != BZ_OK) {
                damaged(result == BZ_MEM_ERROR ? "no memory" : "not bzip2 data");
            }
        }
        return room - stream_.avail_out;
    }

 private:
    void start() {
        stream_ = {};
        if (BZ2_bzDecompressInit(&stream_, 0, 0) != BZ_OK)
            throw IoError(name() + ": no memory for unpacking");
    }
    bz_stream stream_{};
};

class ZstdSource : public PackedSource {
 public:
    // A block of 128 kB takes at least 4 bytes.
    explicit ZstdSource(std::unique_ptr<RawFile> file)
        : PackedSource(std::move(file), "zstd", 32769), stream_(ZSTD_createDStream(), ZSTD_freeDStream) {
        if (!stream_) throw IoError(name() + ": no memory for unpacking");
    }

 protected:
    std::size_t read_some(void* out, std::size_t bytes) override {
        ZSTD_outBuffer output{out, bytes, 0};
        while (!ended_ && output.pos == 0) {
            // Bytes that were unpacked but did not fit come without new input.
            if (!refill() && between_frames_) return ended_ = true, 0;
            ZSTD_inBuffer input{input_.data(), filled_, next_};
            const std::size_t before = input.pos;
            const std::size_t result = ZSTD_decompressStream(stream_.get(), &output, &input);
            next_ = input.pos;
            if (ZSTD_isError(result)) damaged(ZSTD_getErrorName(result));
            between_frames_ = result == 0;
            if (filled_ == 0 && input.pos == before && output.pos == 0)
                return cut_off_ = true, ended_ = true, 0;
        }
        return output.pos;
    }

 private:
    std::unique_ptr<ZSTD_DStream, std::size_t (*)(ZSTD_DStream*)> stream_;
    bool between_frames_ = true;
};

}  // namespace

std::unique_ptr<ByteSource> ByteSource::open(const std::filesystem::path& path) {
    auto file = std::make_unique<RawFile>(path);
    if (file->starts_with({0x1f, 0x8b, 8})) return std::make_unique<GzipSource>(std::move(file));
    const bool block = file->peek(4) == 0x31 && file->peek(5) == 0x41 && file->peek(6) == 0x59;
    const bool nothing = file->peek(4) == 0x17 && file->peek(5) == 0x72 && file->peek(6) == 0x45;
    if (file->starts_with({'B', 'Z', 'h'}) && (block || nothing))
        return std::make_unique<Bzip2Source>(std::move(file));
    if (file->starts_with({0x28, 0xb5, 0x2f, 0xfd})) return std::make_unique<ZstdSource>(std::move(file));
    return std::make_unique<PlainSource>(std::move(file));
}

std::size_t ByteSource::read(void* out, std::size_t bytes) {
    std::size_t done = 0;
    while (done < bytes) {
        const std::size_t n = read_some(static_cast<char*>(out) + done, bytes - done);
        if (n == 0) break;
        done += n;
        position_ += n;
    }
    return done;
}

std::uint64_t ByteSource::skip(std::uint64_t bytes) {
    std::uint64_t done = seek_past(bytes);
    position_ += done;
    std::vector<char> scratch(std::min<std::uint64_t>(bytes - done, input_bytes));
    while (done < bytes) {
        const std::size_t n = read(scratch.data(), std::min<std::uint64_t>(bytes - done, scratch.size()));
        if (n == 0) break;
        done += n;
    }
    return done;
}

}  // namespace vdbgeo
