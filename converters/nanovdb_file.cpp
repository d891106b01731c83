#include "converters/nanovdb_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"

#ifdef VDBGEO_HAVE_NANOVDB
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#endif

namespace vdbgeo {

#ifdef VDBGEO_HAVE_NANOVDB
namespace {

/// Memory for a NanoVDB grid that begins as zeros: NanoVDB leaves the gaps between its nodes as they are, and
/// the same grid has to give the same bytes.
class ZeroedBuffer {
 public:
    ZeroedBuffer() = default;
    static ZeroedBuffer create(std::uint64_t size, const ZeroedBuffer* = nullptr) {
        ZeroedBuffer buffer;
        buffer.memory_.assign((size + sizeof(Block) - 1) / sizeof(Block), Block{});
        buffer.size_ = size;
        return buffer;
    }
    std::uint8_t* data() { return memory_.empty() ? nullptr : memory_.front().bytes; }
    const std::uint8_t* data() const { return memory_.empty() ? nullptr : memory_.front().bytes; }
    std::uint64_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    void clear() { *this = {}; }

 private:
    struct alignas(NANOVDB_DATA_ALIGNMENT) Block {
        std::uint8_t bytes[NANOVDB_DATA_ALIGNMENT];
    };
    std::vector<Block> memory_;
    std::uint64_t size_ = 0;
};

nanovdb::GridHandle<ZeroedBuffer> converted(const openvdb::GridBase& grid) {
    // Means and deviations would be sums whose order depends on the threads; nobody reads them.
    constexpr auto stats = nanovdb::StatsMode::MinMax;
    constexpr auto checksum = nanovdb::ChecksumMode::Full;
    if (const auto* floats = dynamic_cast<const openvdb::FloatGrid*>(&grid))
        return nanovdb::openToNanoVDB<ZeroedBuffer>(*floats, stats, checksum);
    if (const auto* vectors = dynamic_cast<const openvdb::Vec3SGrid*>(&grid))
        return nanovdb::openToNanoVDB<ZeroedBuffer>(*vectors, stats, checksum);
    throw InvalidInput(
        fmt::format("grid '{}' holds {}: NanoVDB files are written of floats and float vectors",
                    grid.getName(), grid.valueType()));
}

}  // namespace

bool have_nanovdb() { return true; }

void write_nanovdb(const std::vector<openvdb::GridBase::ConstPtr>& grids, const std::filesystem::path& path,
                   const Progress& progress) {
    AtomicFile file(path);
    for (std::size_t g = 0; g < grids.size(); ++g) {
        nanovdb::io::writeGrid(file.stream(), converted(*grids[g]), nanovdb::io::Codec::NONE);
        progress.report(static_cast<double>(g + 1) / static_cast<double>(grids.size()));
    }
    file.commit();
}

#else

bool have_nanovdb() { return false; }

void write_nanovdb(const std::vector<openvdb::GridBase::ConstPtr>&, const std::filesystem::path& path,
                   const Progress&) {
    throw InvalidInput(fmt::format(
        "{}: this build writes no NanoVDB files: install libnanovdb-dev and build again, or write a .vdb",
        path.string()));
}

#endif

bool is_nanovdb_ending(const std::filesystem::path& path) {
    std::string ending = path.extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    return ending == ".nvdb";
}

}  // namespace vdbgeo
