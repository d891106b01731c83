// Sections → an MRC file.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "converters/dense_sections.h"
#include "converters/mrc.h"
#include "converters/mrc_metadata.h"

namespace vdbgeo {

/// Writes the sections of a map to an MRC2014 file as they come, in file order (record.order), any number at
/// a time. The file appears whole or not at all (AtomicFile).
///
/// One pass is enough where the header can be put in last: the file is a regular one. Its statistics are
/// gathered from the stored numbers, as a reader will find them. In a gzip file the header is a member of its
/// own, stored as it is, so that there, too, it can be put in last. A pipe takes the header first: one more
/// pass for the statistics; an automatic scaling needs the range of the values: one more pass. `passes` tells
/// how often all sections have to be given:
///
///     for (int pass = 0; pass < sink.passes(); ++pass)
///         for (each piece) sink.write(sections, count);
///     sink.finish();
///
/// A source that can be gone through only once may give what it knows of the values instead.
///
/// The bytes do not depend on how the sections were cut into pieces. Memory: nothing in mode 2, else 4 bytes
/// for each sample of the largest piece and the packed samples; 40 MB for gzip.
class MrcSink {
 public:
    /// frame.size samples from index `first` of a map that lies as `frame` says. `known`: the statistics of
    /// the values that will be given; they spare the passes that would find them. Throws InvalidInput where
    /// options or frame cannot be written, IoError where the file cannot.
    MrcSink(const std::filesystem::path& path, const Frame& frame, const Vec3i& first,
            const MrcRecord& record, const MrcWriteOptions& options = {},
            const std::optional<Statistics>& known = {});
    ~MrcSink();

    int passes() const;
    /// More than one pass: something has to be known before the first section is written.
    bool needs_statistics() const { return passes() > 1; }

    /// Takes the next `count` sections of the running pass, columns fastest. Throws InvalidInput for a value
    /// that does not fit into the mode, naming its voxel; IoError.
    void write(const float* sections, int count);
    /// Puts the file in its place; InvalidInput where sections are missing.
    MrcWriteReport finish();

 private:
    struct State;
    std::unique_ptr<State> state_;
};

/// The part of a map that is written: frame.size samples from index `first`.
struct MrcBox {
    Frame frame;
    Vec3i first = Vec3i::Zero();
};

/// The box of a bounded frame, else that of the active voxels. Throws InvalidInput where there is neither.
MrcBox mrc_box(const Frame& frame, const openvdb::CoordBBox& active);

/// Gives all sections of `source` to a sink, as often as it wants them, and finishes it. One piece of
/// DenseSections is in memory.
MrcWriteReport write_sections(const DenseSections& source, MrcSink& sink, const Progress& progress = {});

/// What write_mrc does, wherever the samples come from: `meta` holds the record of the file that the map came
/// from, `sections` makes the source once the box and the order of the axes are known.
MrcWriteReport write_mrc_from(
    const openvdb::MetaMap& meta, const Frame& frame, const openvdb::CoordBBox& active,
    const std::filesystem::path& path, const MrcWriteOptions& options,
    const std::function<DenseSections(const MrcBox&, const std::array<int, 3>&)>& sections,
    const Progress& progress);

}  // namespace vdbgeo
