#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/io.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <sstream>

#include "converters/self_writing_grid.h"
#include "converters/vdb_checksum.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;

/// The same grid, whose leaf buffers are serialised on all threads: OpenVDB writes them one after another.
class ParallelGrid : public SelfWritingGrid {
 public:
    explicit ParallelGrid(const FloatGrid& grid)
        : SelfWritingGrid(std::const_pointer_cast<FloatTree>(grid.constTreePtr())) {
        static_cast<openvdb::MetaMap&>(*this) = grid;
        // Not a copy: that would take the scale from differences of moved points, and round it.
        setTransform(std::const_pointer_cast<openvdb::math::Transform>(grid.constTransformPtr()));
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
            progress().report(static_cast<double>(written) / static_cast<double>(leaves.size()));
        };
        tbb::parallel_pipeline(
            16, tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, take) &
                    tbb::make_filter<std::size_t, std::shared_ptr<std::string>>(tbb::filter_mode::parallel,
                                                                                serialise) &
                    tbb::make_filter<std::shared_ptr<std::string>, void>(tbb::filter_mode::serial_in_order,
                                                                         write));
    }

 private:
    void write_nodes(std::ostream& os) const override { FloatGrid::writeTopology(os); }

    static constexpr std::size_t chunk = 256;  // leaves: half a megabyte
};

/// Archive's writer is for derived classes only.
class Writer : public openvdb::io::Archive {
 public:
    openvdb::io::Archive::Ptr copy() const override { return std::make_shared<Writer>(*this); }
    void write_to(std::ostream& os, const openvdb::GridCPtrVec& grids) const {
        openvdb::MetaMap metadata;
        metadata.insertMeta(vdb_checksum_key, openvdb::StringMetadata(blank_vdb_checksum()));
        write(os, grids, true, metadata);
    }
};

/// The identifier in the header is random: another one every time. Readers only compare it with that of a
/// file they have open, so a name-based one serves, and the same input gives the same bytes.
std::string identifier_of(const openvdb::GridCPtrVec& grids) {
    std::uint64_t hash[2] = {0xCBF29CE484222325ull, 0x9AE16A3B2F90404Full};
    for (const auto& grid : grids) {
        const std::string text =
            fmt::format("{}:{}:{};", grid->getName(), grid->type(), grid->activeVoxelCount());
        for (const char c : text)
            for (auto& h : hash) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001B3ull + (h >> 29);
    }
    return fmt::format("{:08x}-{:04x}-4{:03x}-8{:03x}-{:012x}", hash[0] >> 32, hash[0] >> 16 & 0xFFFF,
                       hash[0] & 0xFFF, hash[1] >> 52, hash[1] & 0xFFFFFFFFFFFFull);
}

/// What the archive writes in the place of a grid.
openvdb::GridBase::ConstPtr prepared(const openvdb::GridBase::ConstPtr& grid, const VdbWriteOptions& options,
                                     const Progress& progress) {
    if (const auto* own = dynamic_cast<const SelfWritingGrid*>(grid.get())) {
        own->report_to(progress);
        return grid;
    }
    openvdb::GridBase::Ptr copy;
    if (const auto floats = openvdb::GridBase::grid<FloatGrid>(grid))
        copy = std::make_shared<ParallelGrid>(*floats);
    else
        copy = std::const_pointer_cast<openvdb::GridBase>(grid->copyGrid());
    if (const auto* own = dynamic_cast<const SelfWritingGrid*>(copy.get())) own->report_to(progress);
    if (copy->saveFloatAsHalf() != options.half) copy->setSaveFloatAsHalf(options.half);
    return copy;
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
    openvdb::GridCPtrVec all;
    for (std::size_t g = 0; g < grids.size(); ++g) {
        const double many = static_cast<double>(grids.size());
        all.push_back(
            prepared(grids[g], options,
                     progress.part(static_cast<double>(g) / many, static_cast<double>(g + 1) / many)));
    }
    AtomicFile file(path);
    Writer writer;
    writer.setCompression(flags);
    try {
        file.stream().seekp(0);  // fails at once for a pipe
        writer.write_to(file.stream(), all);
        seal_vdb(file, identifier_of(all));
    } catch (const openvdb::Exception& e) {
        throw IoError(fmt::format("{}: {}", path.string(), e.what()));
    } catch (const std::ios_base::failure&) {
        throw IoError(fmt::format("{}: a VDB file cannot be written to a pipe", path.string()));
    }
    progress.report(1);  // the last chance to cancel
    file.commit();
}

}  // namespace vdbgeo
