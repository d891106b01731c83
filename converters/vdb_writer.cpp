#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/io.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <sstream>

#include "converters/self_writing_grid.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;

/// The same grid, whose leaf buffers are serialised on all threads: OpenVDB writes them one after another.
class ParallelGrid : public FloatGrid {
 public:
    ParallelGrid(const FloatGrid& grid, const Progress& progress)
        : FloatGrid(std::const_pointer_cast<FloatTree>(grid.constTreePtr())), progress_(progress) {
        static_cast<openvdb::MetaMap&>(*this) = grid;
        setTransform(grid.transform().copy());
    }

    void writeBuffers(std::ostream& os) const override {
        std::vector<const Leaf*> leaves;
        leaves.reserve(constTree().leafCount());
        constTree().getNodes(leaves);  // depth first, as OpenVDB writes them
        const bool half = saveFloatAsHalf();
        std::size_t next = 0;
        const auto take = [&](tbb::flow_control& flow) {
            const std::size_t begin = next;
            if (begin >= leaves.size()) flow.stop();
            next = std::min(begin + chunk, leaves.size());
            return begin;
        };
        const std::uint32_t compression = openvdb::io::getDataCompression(os);
        const std::uint32_t grid_class = openvdb::io::getGridClass(os);
        const float background = constTree().background();
        const auto serialise = [&](std::size_t begin) {
            std::ostringstream out(std::ios::binary);
            openvdb::io::setDataCompression(out, compression);
            openvdb::io::setGridClass(out, grid_class);
            openvdb::io::setGridBackgroundValuePtr(out, &background);
            for (std::size_t i = begin; i < std::min(begin + chunk, leaves.size()); ++i)
                leaves[i]->writeBuffers(out, half);
            return std::make_shared<std::string>(out.str());
        };
        std::size_t written = 0;
        const auto write = [&](const std::shared_ptr<std::string>& bytes) {
            os.write(bytes->data(), static_cast<std::streamsize>(bytes->size()));
            written += chunk;
            progress_.report(static_cast<double>(written) / static_cast<double>(leaves.size()));
        };
        tbb::parallel_pipeline(
            16, tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, take) &
                    tbb::make_filter<std::size_t, std::shared_ptr<std::string>>(tbb::filter_mode::parallel,
                                                                                serialise) &
                    tbb::make_filter<std::shared_ptr<std::string>, void>(tbb::filter_mode::serial_in_order,
                                                                         write));
    }

 private:
    static constexpr std::size_t chunk = 256;  // leaves: half a megabyte
    Progress progress_;
};

/// Archive's writer is for derived classes only.
class Writer : public openvdb::io::Archive {
 public:
    openvdb::io::Archive::Ptr copy() const override { return std::make_shared<Writer>(*this); }
    void write_to(std::ostream& os, const openvdb::GridCPtrVec& grids) const { write(os, grids, true, {}); }
};

/// The identifier in the header is random: another one every time. Readers only compare it with that of a
/// file they have open, so a name-based one serves, and the same input gives the same bytes.
void replace_identifier(std::ostream& os, const openvdb::GridCPtrVec& grids) {
    std::uint64_t hash[2] = {0xCBF29CE484222325ull, 0x9AE16A3B2F90404Full};
    for (const auto& grid : grids) {
        const std::string text =
            fmt::format("{}:{}:{};", grid->getName(), grid->type(), grid->activeVoxelCount());
        for (const char c : text)
            for (auto& h : hash) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001B3ull + (h >> 29);
    }
    const std::string id =
        fmt::format("{:08x}-{:04x}-4{:03x}-8{:03x}-{:012x}", hash[0] >> 32, hash[0] >> 16 & 0xFFFF,
                    hash[0] & 0xFFF, hash[1] >> 52, hash[1] & 0xFFFFFFFFFFFFull);
    constexpr std::streamoff identifier_at =
        8 + 4 + 8 + 1;  // signature, version, library version, offsets flag
    os.seekp(identifier_at);
    os.write(id.data(), static_cast<std::streamsize>(id.size()));
    os.seekp(0, std::ios::end);
}

}  // namespace

std::uint32_t compression_flags(const VdbWriteOptions& options) {
    std::uint32_t flags = openvdb::io::COMPRESS_ACTIVE_MASK;
    if (options.compression == VdbWriteOptions::Compression::zip) flags |= openvdb::io::COMPRESS_ZIP;
    if (options.compression == VdbWriteOptions::Compression::blosc) flags |= openvdb::io::COMPRESS_BLOSC;
    return flags;
}

void write_vdb(const std::vector<openvdb::GridBase::ConstPtr>& grids, const std::filesystem::path& path,
               const VdbWriteOptions& options, const Progress& progress) {
    options.check();
    openvdb::initialize();
    const std::uint32_t flags = compression_flags(options);
    openvdb::GridCPtrVec prepared;
    for (std::size_t g = 0; g < grids.size(); ++g) {
        const double from = static_cast<double>(g) / static_cast<double>(grids.size());
        const double to = static_cast<double>(g + 1) / static_cast<double>(grids.size());
        openvdb::GridBase::Ptr grid;
        if (dynamic_cast<const SelfWritingGrid*>(grids[g].get()))
            grid = std::const_pointer_cast<openvdb::GridBase>(grids[g]);
        else if (const auto floats = openvdb::GridBase::grid<FloatGrid>(grids[g]))
            grid = std::make_shared<ParallelGrid>(*floats, progress.part(from, to));
        else
            grid = std::const_pointer_cast<openvdb::GridBase>(grids[g]->copyGrid());
        if (grid->saveFloatAsHalf() != options.half) grid->setSaveFloatAsHalf(options.half);
        prepared.push_back(grid);
    }
    AtomicFile file(path);
    Writer writer;
    writer.setCompression(flags);
    try {
        file.stream().seekp(0);  // fails at once for a pipe
        writer.write_to(file.stream(), prepared);
        replace_identifier(file.stream(), prepared);
    } catch (const openvdb::Exception& e) {
        throw IoError(fmt::format("{}: {}", path.string(), e.what()));
    } catch (const std::ios_base::failure&) {
        throw IoError(fmt::format("{}: a VDB file cannot be written to a pipe", path.string()));
    }
    progress.report(1);  // the last chance to cancel
    file.commit();
}

}  // namespace vdbgeo
