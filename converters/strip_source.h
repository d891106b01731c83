// The samples of an MRC file as strips, a row of blocks each: cropped, binned, negated, on the scale asked
// for.
#pragma once

#include <functional>
#include <memory>

#include "converters/map_options.h"
#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Goes through a map file as often as it was said to, never holding more than a few strips a thread (plain
/// files) or two slabs (packed ones and pipes).
///
/// Plain files are read at any place by the threads that work on the samples, while another thread asks the
/// system for what comes next. Packed files and pipes are unpacked by another thread, one slab ahead; where
/// they are to be gone through twice, or their slabs would take over a quarter of the memory, they are first
/// unpacked to a temporary file. Integer samples stay 16-bit integers where nothing makes fractions of them.
class StripSource {
 public:
    /// `passes`: how often pass() will be called. Errors as MrcReader; InvalidInput where the crop lies
    /// outside the map or less than one block of samples is left to bin.
    StripSource(const std::filesystem::path& path, const MapReadOptions& options, int passes);
    ~StripSource();
    StripSource(const StripSource&) = delete;
    StripSource& operator=(const StripSource&) = delete;

    const MrcReader& reader() const;
    /// Of the samples handed out: after crop and bin.
    const Frame& frame() const;
    const std::array<int, 3>& order() const;
    /// Column, row and section of the file at which the crop begins.
    const std::array<int, 3>& first() const;
    /// What was done beyond reading, and what is odd about the file: one line each.
    std::vector<std::string> warnings() const;
    /// Bytes that went to a temporary file; 0: none.
    std::uint64_t unpacked() const;

    /// From the next pass on samples are handed out as (value − shift) · factor.
    void scale(double shift, double factor);

    /// From the next pass on only these strips of eight rows and eight sections are handed out; of a plain
    /// file nothing else is read. For passes with a height of eight sections.
    struct Range {
        int first_row = 0, end_row = 0, first_slab = 0, end_slab = 0;
    };
    void restrict_to(const Range& range);

    /// Hands out every strip of eight rows and `height` sections once, on any thread: slab after slab in file
    /// order, and within a slab `group` strips at a time (0: all). `begin` is told how many strips come next,
    /// `visit` gets each of them with its place among them, `end` is called when all were visited.
    using Begin = std::function<void(std::size_t strips)>;
    using Visit = std::function<void(const Strip& strip, int slab, int row, std::size_t place)>;
    using End = std::function<void()>;
    void pass(const Visit& visit, const Begin& begin, const End& end, const Progress& progress = {},
              int height = leaf::dim, int group = 0);

 private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Statistics over all samples that `source` hands out: one pass.
Statistics strip_statistics(StripSource& source, const Progress& progress = {});

}  // namespace vdbgeo
