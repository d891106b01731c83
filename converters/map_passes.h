// A map file gone through as often as its options ask for: statistics, percentile, choice of samples,
// samples.
#pragma once

#include "converters/map_file.h"
#include "converters/strip_source.h"

namespace vdbgeo {

/// What has to be known before the samples of a map can be sorted into leaves, and then the sorting.
///
///     MapPasses passes(path, options);                     // header, size, frame: nothing read yet
///     passes.prepare(progress);                            // every pass but the last
///     passes.sort(take, progress);                         // the last
class MapPasses {
 public:
    /// So often are the samples wanted by who reads parts of them.
    static constexpr int in_parts = 1 << 20;

    /// Errors as StripSource. `path` may be a pipe: see StripSource.
    /// `last`: how often the samples are wanted after prepare().
    MapPasses(const std::filesystem::path& path, const MapReadOptions& options, int last = 1);

    /// Statistics, percentile and selection, as far as they are wanted.
    void prepare(const Progress& progress = {});

    /// Sorts all samples. `take` gets whole slabs, or parts of a slab that begin with a multiple of sixteen
    /// rows where a slab of packed leaves could take more than an eighth of the memory: the strips in the
    /// order of their rows, each turned into a `Packed` by `pack` on the thread that sorted it.
    template <class Pack, class Take>
    void sort(const Pack& pack, const Take& take, const Progress& progress);

    StripSource& source() { return source_; }
    const StripSorter& sorter() const { return *sorter_; }
    const openvdb::MaskTree* keep() const { return keep_.get(); }
    /// With the threshold that was found.
    const SparsifyOptions& sparsify() const { return sparsify_; }
    /// Of the samples as they are handed out, where a pass was made for them.
    const std::optional<Statistics>& statistics() const { return statistics_; }
    /// One line on what is done to the samples.
    std::string history() const;
    std::uint64_t despeckled() const { return despeckled_; }
    int passes() const;
    /// Those that prepare() makes.
    int passes_before() const { return passes_before(options_); }
    /// What a grid has to remember of the file, as store_mrc_metadata; mode 2 once values became others.
    void store_metadata(openvdb::MetaMap& meta) const;
    /// What was done that the user may want to know, one line each.
    std::vector<std::string> notes() const;

 private:
    static int passes_before(const MapReadOptions& options);
    int group() const;
    void find_statistics(const Progress& progress);
    void find_percentile(const Progress& progress);
    void select(const Progress& progress);
    openvdb::MaskTree::Ptr voxels_above(const SparsifyOptions& what, const Progress& progress);
    openvdb::MaskTree::Ptr read_mask(const Progress& progress) const;
    void check_memory(const openvdb::MaskTree& mask) const;

    std::string name_, file_;
    MapReadOptions options_;
    int last_;
    SparsifyOptions sparsify_;
    StripSource source_;
    Vec3i size_;
    std::optional<Statistics> statistics_;
    std::shared_ptr<openvdb::MaskTree> keep_;
    std::unique_ptr<StripSorter> sorter_;
    std::uint64_t despeckled_ = 0;
};

/// Warnings, notes and metadata of a map whose samples are sorted.
void finish_map_file(MapPasses& passes, MapFile& result);

/// A map of the grid in a VDB file, taken back to Å where it was placed for a program, with warnings of the
/// options that do not apply to it. InvalidInput where its transform makes no frame.
MapFile map_of_vdb(const openvdb::FloatGrid::Ptr& grid, const std::filesystem::path& path,
                   const MapReadOptions& options);

template <class Pack, class Take>
void MapPasses::sort(const Pack& pack, const Take& take, const Progress& progress) {
    using Packed = decltype(pack(std::declval<SortedStrip>()));
    std::vector<Packed> packed;
    source_.pass([&](const Strip& strip, int slab, int row,
                     std::size_t place) { packed[place] = pack(sorter_->sort(strip, slab, row)); },
                 [&](std::size_t strips) {
                     packed.clear();
                     packed.resize(strips);
                 },
                 [&] { take(std::move(packed)); }, progress, leaf::dim, group());
}

}  // namespace vdbgeo
