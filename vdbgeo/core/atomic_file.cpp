#include "vdbgeo/core/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <streambuf>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace fs = std::filesystem;

/// A buffered streambuf over a file descriptor that remembers and throws every failure.
class AtomicFile::Sink : public std::streambuf {
 public:
    explicit Sink(const fs::path& target);
    ~Sink() override;
    Sink(const Sink&) = delete;
    Sink& operator=(const Sink&) = delete;

    void commit();
    bool seekable() const { return !direct_; }
    void write_at(std::int64_t position, const char* data, std::size_t bytes);
    void read_at(std::int64_t position, char* out, std::size_t bytes) const;
    std::uint64_t flush();

 protected:
    int_type overflow(int_type c) override;
    std::streamsize xsputn(const char* data, std::streamsize count) override;
    int sync() override;
    pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override;
    pos_type seekpos(pos_type position, std::ios_base::openmode mode) override {
        return seekoff(off_type(position), std::ios_base::beg, mode);
    }

 private:
    static constexpr std::size_t buffer_bytes = 1 << 20;
    static constexpr std::int64_t writeback_bytes = 16 << 20;

    [[noreturn]] void fail(const char* doing, int error) const {
        throw IoError(fmt::format("{}: {}: {}", name_, doing, std::strerror(error)));
    }
    void open_temporary();
    void flush_buffer();
    void write_all(const char* data, std::size_t bytes);

    fs::path target_, temporary_;
    std::string name_;
    int fd_ = -1;
    bool direct_ = false;  // not a regular file: no temporary, no rename
    bool committed_ = false;
    bool lost_ = false;              // a write failed: what follows it must not become the target
    std::int64_t offset_ = 0;        // file offset of the buffer's start
    std::int64_t written_back_ = 0;  // up to here the kernel was asked to start writing
    std::vector<char> buffer_;
};

AtomicFile::Sink::Sink(const fs::path& target)
    : target_(target), name_(target.string()), buffer_(buffer_bytes) {
    if (name_ == "-") {
        name_ = "standard output";
        fd_ = ::dup(STDOUT_FILENO);
        direct_ = true;
    } else {
        std::error_code ignored;
        // A link is followed: its target is replaced, the link stays.
        if (fs::is_symlink(target_, ignored) && fs::exists(target_, ignored))
            target_ = fs::canonical(target_);
        struct stat status {};
        if (::stat(target_.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
            if (S_ISDIR(status.st_mode)) throw IoError(fmt::format("{}: is a directory", name_));
            fd_ = ::open(target_.c_str(), O_WRONLY | O_CLOEXEC);
            direct_ = true;
        } else {
            open_temporary();
        }
    }
    if (fd_ < 0) fail("cannot be opened for writing", errno);
    setp(buffer_.data(), buffer_.data() + buffer_.size());
}

void AtomicFile::Sink::open_temporary() {
    const fs::path folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
    struct stat status {};
    const bool exists = ::stat(target_.c_str(), &status) == 0;
    if (exists && ::access(target_.c_str(), W_OK) != 0) fail("cannot be written", errno);
#ifdef O_TMPFILE
    fd_ = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666);
#endif
    if (fd_ < 0) {  // a file system without unnamed files
        std::string pattern = (folder / ".vdbgeo.XXXXXX").string();
        fd_ = ::mkostemp(pattern.data(), O_CLOEXEC);
        if (fd_ < 0) fail("cannot be created", errno);
        temporary_ = pattern;
        const mode_t mask = ::umask(0);
        ::umask(mask);
        ::fchmod(fd_, 0666 & ~mask);
    }
    if (exists) ::fchmod(fd_, status.st_mode & 07777);
}

AtomicFile::Sink::~Sink() {
    if (fd_ >= 0) ::close(fd_);
    if (!committed_ && !temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::Sink::write_all(const char* data, std::size_t bytes) {
    while (bytes > 0) {
        const ssize_t n = ::write(fd_, data, bytes);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            lost_ = true;
            fail("writing failed", errno);
        }
        data += n;
        bytes -= static_cast<std::size_t>(n);
        offset_ += n;
    }
    // Starting the write-back early leaves little for the final fsync to wait for.
    if (!direct_ && offset_ - written_back_ >= writeback_bytes) {
        ::sync_file_range(fd_, written_back_, offset_ - written_back_, SYNC_FILE_RANGE_WRITE);
        written_back_ = offset_;
    }
}

void AtomicFile::Sink::flush_buffer() {
    const std::size_t pending = static_cast<std::size_t>(pptr() - pbase());
    setp(buffer_.data(), buffer_.data() + buffer_.size());
    write_all(buffer_.data(), pending);
}

void AtomicFile::Sink::write_at(std::int64_t position, const char* data, std::size_t bytes) {
    flush_buffer();
    const std::int64_t begin = position;
    while (bytes > 0) {
        const ssize_t n = ::pwrite(fd_, data, bytes, position);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            lost_ = true;
            fail("writing failed", errno);
        }
        data += n;
        bytes -= static_cast<std::size_t>(n);
        position += n;
    }
    // Large pieces are on their way to the disk at once, as in write_all.
    if (!direct_ && position - begin >= static_cast<std::int64_t>(buffer_bytes))
        ::sync_file_range(fd_, begin, position - begin, SYNC_FILE_RANGE_WRITE);
}

void AtomicFile::Sink::read_at(std::int64_t position, char* out, std::size_t bytes) const {
    while (bytes > 0) {
        const ssize_t n = ::pread(fd_, out, bytes, position);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) fail("reading back failed", n < 0 ? errno : EIO);
        out += n;
        bytes -= static_cast<std::size_t>(n);
        position += n;
    }
}

std::uint64_t AtomicFile::Sink::flush() {
    flush_buffer();
    struct stat status {};
    if (::fstat(fd_, &status) != 0) fail("writing failed", errno);
    return static_cast<std::uint64_t>(status.st_size);
}

AtomicFile::Sink::int_type AtomicFile::Sink::overflow(int_type c) {
    flush_buffer();
    if (!traits_type::eq_int_type(c, traits_type::eof())) sputc(traits_type::to_char_type(c));
    return traits_type::not_eof(c);
}

std::streamsize AtomicFile::Sink::xsputn(const char* data, std::streamsize count) {
    if (count > epptr() - pptr()) {
        flush_buffer();
        if (count >= static_cast<std::streamsize>(buffer_bytes)) {
            write_all(data, static_cast<std::size_t>(count));
            return count;
        }
    }
    std::memcpy(pptr(), data, static_cast<std::size_t>(count));
    pbump(static_cast<int>(count));
    return count;
}

int AtomicFile::Sink::sync() {
    flush_buffer();
    return 0;
}

AtomicFile::Sink::pos_type AtomicFile::Sink::seekoff(off_type offset, std::ios_base::seekdir from,
                                                     std::ios_base::openmode) {
    if (from == std::ios_base::cur && offset == 0) return pos_type(offset_ + (pptr() - pbase()));
    if (direct_) return pos_type(off_type(-1));
    flush_buffer();
    const int whence = from == std::ios_base::beg   ? SEEK_SET
                       : from == std::ios_base::cur ? SEEK_CUR
                                                    : SEEK_END;
    const off_t reached = ::lseek(fd_, offset, whence);
    if (reached < 0) fail("seeking failed", errno);
    offset_ = reached;
    return pos_type(reached);
}

void AtomicFile::Sink::commit() {
    if (lost_) fail("writing failed", EIO);
    flush_buffer();
    if (direct_) {
        if (::close(std::exchange(fd_, -1)) != 0) fail("writing failed", errno);
        committed_ = true;
        return;
    }
    if (::fsync(fd_) != 0) fail("writing failed", errno);
    if (temporary_.empty()) {  // give the unnamed file a name that can be renamed over the target
        const std::string self = fmt::format("/proc/self/fd/{}", fd_);
        for (int attempt = 0; temporary_.empty(); ++attempt) {
            fs::path candidate = target_;
            // Not longer than the target's name may be on its own.
            candidate.replace_filename(fmt::format(".vdbgeo.{}.{}", ::getpid(), attempt));
            if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, candidate.c_str(), AT_SYMLINK_FOLLOW) == 0)
                temporary_ = candidate;
            else if (errno != EEXIST || attempt > 100)
                fail("cannot be created", errno);
        }
    }
    if (::close(std::exchange(fd_, -1)) != 0) fail("writing failed", errno);
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("cannot be replaced", errno);
    committed_ = true;
    // The new name is on the disk once the folder is.
    const fs::path folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
    const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (directory >= 0) {
        ::fsync(directory);
        ::close(directory);
    }
}

AtomicFile::AtomicFile(const fs::path& target) : sink_(std::make_unique<Sink>(target)) {
    stream_ = std::make_unique<std::ostream>(sink_.get());
    stream_->exceptions(std::ios::badbit | std::ios::failbit);
}

AtomicFile::~AtomicFile() = default;

std::ostream& AtomicFile::stream() { return *stream_; }
void AtomicFile::write(std::string_view bytes) { write(bytes.data(), bytes.size()); }
void AtomicFile::write(const void* data, std::size_t bytes) {
    sink_->sputn(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
}
bool AtomicFile::seekable() const { return sink_->seekable(); }
void AtomicFile::write_at(std::uint64_t position, const void* data, std::size_t bytes) {
    sink_->write_at(static_cast<std::int64_t>(position), static_cast<const char*>(data), bytes);
}
void AtomicFile::read_at(std::uint64_t position, void* out, std::size_t bytes) const {
    sink_->read_at(static_cast<std::int64_t>(position), static_cast<char*>(out), bytes);
}
std::uint64_t AtomicFile::flush() { return sink_->flush(); }
void AtomicFile::commit() { sink_->commit(); }

void write_file(const fs::path& target, std::string_view bytes) {
    AtomicFile file(target);
    file.write(bytes);
    file.commit();
}

}  // namespace vdbgeo
