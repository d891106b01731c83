#include "converters/map_passes.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/components.h"
#include "vdbgeo/volume/order_statistic.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::MaskTree;

bool wants_statistics(const MapReadOptions& o) {
    return o.normalise != MapReadOptions::Normalise::none ||
           (o.threshold && o.threshold->kind == ThresholdRule::Kind::sigma) ||
           (o.quantise && o.quantise->kind == ThresholdRule::Kind::sigma);
}

bool wants_percentile(const MapReadOptions& o) {
    return o.threshold && (o.threshold->kind == ThresholdRule::Kind::percentile ||
                           o.threshold->kind == ThresholdRule::Kind::fraction);
}

void check_mask_size(const std::string& name, const Vec3i& mask, const Vec3i& map) {
    if (mask != map)
        throw InvalidInput(fmt::format("{}: the mask has {} x {} x {} samples, the map {} x {} x {}", name,
                                       mask[0], mask[1], mask[2], map[0], map[1], map[2]));
}

/// Puts the active voxels of a sorted map into a mask.
void add_voxels(const std::vector<SortedStrip>& strips, MaskTree& mask) {
    for (const SortedStrip& strip : strips)
        for (const SortedBlock& block : strip.blocks) {
            if (block.leaf)
                mask.addLeaf(new MaskTree::LeafNodeType(*block.leaf, openvdb::TopologyCopy()));
            else if (block.tile == SortedBlock::Tile::kept)
                mask.addTile(1, block.origin, true, true);
        }
}

}  // namespace

int MapPasses::passes_before(const MapReadOptions& o) {
    return (wants_statistics(o) ? 1 : 0) + (wants_percentile(o) ? OrderStatistic::passes : 0) +
           (o.needs_selection() && (o.threshold || o.sparsify.threshold) ? 1 : 0);
}

MapPasses::MapPasses(const std::filesystem::path& path, const MapReadOptions& options, int last)
    : name_(path == "-" ? "standard input" : path.string()),
      file_(path.filename().string()),
      options_(options),
      last_(last),
      sparsify_(options.sparsify),
      source_(path, options, passes_before(options) + last),
      size_(source_.frame().size) {}

int MapPasses::passes() const { return passes_before(options_) + last_; }

void MapPasses::store_metadata(openvdb::MetaMap& meta) const {
    store_mrc_metadata(meta, source_.reader(), file_);
    const MrcHeader& h = source_.reader().header();
    const auto& first = source_.first();
    openvdb::Vec3i start(h.nxstart + first[0], h.nystart + first[1], h.nzstart + first[2]);
    if (options_.bin > 1) start = openvdb::Vec3i(0, 0, 0);  // counted in voxels that are no more
    meta.removeMeta("mrc_nstart");
    meta.insertMeta("mrc_nstart", openvdb::Vec3IMetadata(start));
    const std::string& type = source_.reader().value_type();
    const bool is_unsigned = type == "uint8" || type == "uint16" || type == "uint4";
    if (options_.bin == 1 && options_.normalise == MapReadOptions::Normalise::none && !options_.quantise &&
        !(options_.invert && is_unsigned))
        return;
    meta.removeMeta("mrc_mode");  // its whole numbers do not hold the values
    meta.insertMeta("mrc_mode", openvdb::Int32Metadata(2));
}

std::vector<std::string> MapPasses::notes() const {
    std::vector<std::string> all;
    if (source_.unpacked() > 0)
        all.push_back(
            fmt::format("unpacked to a temporary file of {:.1f} MB, to be gone through {}",
                        static_cast<double>(source_.unpacked()) / 1e6,
                        passes() > 1 && last_ < in_parts ? fmt::format("{} times", passes()) : "in parts"));
    if (options_.despeckle > 1)
        all.push_back(fmt::format("{} voxels were in pieces of fewer than {}, and dropped", despeckled_,
                                  options_.despeckle));
    return all;
}

/// Strips that are packed at a time.
int MapPasses::group() const {
    const auto& order = source_.order();
    const std::uint64_t strip =
        std::uint64_t(4) * leaf::dim * leaf::dim * static_cast<std::uint64_t>(size_[order[0]]);
    const std::uint64_t fit = options_.memory_limit() / 8 / strip;
    return static_cast<int>(std::min<std::uint64_t>(std::max<std::uint64_t>(fit / 16 * 16, 16), 1 << 20));
}

void MapPasses::find_statistics(const Progress& progress) {
    statistics_ = strip_statistics(source_, progress);
}

void MapPasses::find_percentile(const Progress& progress) {
    const ThresholdRule& rule = *options_.threshold;
    const bool percentile = rule.kind == ThresholdRule::Kind::percentile;
    OrderStatistic order(percentile ? rule.number / 100 : 1 - rule.number);
    for (int pass = 0; pass < OrderStatistic::passes && !order.done(); ++pass) {
        source_.pass(
            [&](const Strip& strip, int, int, std::size_t) {
                const std::size_t n = static_cast<std::size_t>(strip.columns);
                Array<float> values(leaf::dim * n);
                for (int s = 0; s < strip.sections; ++s) {
                    for (int r = 0; r < strip.rows; ++r)
                        strip.copy_row(s, r, values.data() + static_cast<std::size_t>(r) * n);
                    order.add(values.data(), static_cast<std::size_t>(strip.rows) * n);
                }
            },
            [](std::size_t) {}, [] {}, progress.part(0.5 * pass, 0.5 * (pass + 1)));
        order.end_pass();
    }
    if (order.count() == 0)
        throw InvalidInput(name_ + ": the map has no finite sample to take a threshold from");
    sparsify_.threshold = order.value();
    if (!percentile && rule.number == 1)  // all of them: the smallest too
        sparsify_.threshold = std::nextafter(order.value(), -std::numeric_limits<float>::infinity());
}

void MapPasses::check_memory(const MaskTree& mask) const {
    // Growing makes a second mask; every thread that searches for components has 16 MB of its own.
    std::uint64_t needed = 2 * mask.memUsage();
    if (options_.despeckle > 1) {
        std::uint64_t blocks = 1, voxels = 1;
        for (int a = 0; a < 3; ++a) {
            blocks *= static_cast<std::uint64_t>((size_[a] - 1) / 128 + 1);
            voxels *= static_cast<std::uint64_t>(size_[a]);
        }
        needed += std::min(static_cast<std::uint64_t>(tbb::this_task_arena::max_concurrency()), blocks) *
                  std::min<std::uint64_t>(16 << 20, 8 * voxels);
    }
    const std::uint64_t limit = options_.memory_limit(), rest = (std::uint64_t(48) << 20) + limit / 8;
    if (needed + rest > limit)
        throw NumericalError(
            fmt::format("{}: choosing what is kept takes {} MB, more than the memory allowed; raise "
                        "--threshold or --memory, or --bin",
                        name_, needed >> 20));
}

MaskTree::Ptr MapPasses::voxels_above(const SparsifyOptions& what, const Progress& progress) {
    auto mask = std::make_shared<MaskTree>();
    sorter_ = std::make_unique<StripSorter>(size_, source_.order(), what);
    int seen = 0;
    sort([](SortedStrip&& strip) { return std::move(strip); },
         [&](const std::vector<SortedStrip>& strips) {
             add_voxels(strips, *mask);
             if (++seen % 64 == 0) check_memory(*mask);
         },
         progress);
    check_memory(*mask);
    return mask;
}

/// Where the mask file is above 0.
MaskTree::Ptr MapPasses::read_mask(const Progress& progress) const {
    const std::string name = options_.mask.string();
    std::error_code ignored;
    if (std::filesystem::exists(options_.mask, ignored) &&
        !std::filesystem::is_regular_file(options_.mask, ignored))
        throw InvalidInput(name + ": a mask is read more than once, and a pipe cannot be: give it as a file");
    SparsifyOptions positive;
    positive.threshold = 0.f;
    if (is_vdb_file(options_.mask)) {
        const auto grid = read_vdb(options_.mask);
        const Frame frame = map_from_grid(grid).frame;
        if (frame.bounded()) check_mask_size(name, frame.size, size_);
        auto mask = std::make_shared<MaskTree>();
        for (auto it = grid->cbeginValueOn(); it; ++it) {
            if (!(*it > 0)) continue;
            if (it.isVoxelValue())
                mask->setValueOn(it.getCoord());
            else
                mask->fill(it.getBoundingBox(), true);
        }
        return mask;
    }
    MapReadOptions options;
    options.memory = options_.memory;
    options.scratch = options_.scratch;
    options.sparsify = positive;
    const Vec3i size = MrcReader(options_.mask).frame().size, whole = source_.reader().frame().size;
    if (size == whole) {
        options.crop = options_.crop;
        options.bin = options_.bin;
    } else {
        check_mask_size(name, size, size_);
    }
    MapPasses passes(options_.mask, options);
    return passes.voxels_above(positive, progress);
}

void MapPasses::select(const Progress& progress) {
    const openvdb::CoordBBox box(Coord(0), Coord(size_.x() - 1, size_.y() - 1, size_.z() - 1));
    MaskTree::Ptr mask;
    if (sparsify_.threshold) mask = voxels_above(sparsify_, progress.part(0, 0.6));
    if (!options_.mask.empty()) {
        const auto allowed = read_mask(progress.part(0.6, 0.8));
        grow(*allowed, 0, box);  // a grid may reach beyond the map
        if (mask)
            mask->topologyIntersection(*allowed);
        else
            mask = allowed;
    }
    if (options_.despeckle > 1) {
        despeckled_ = remove_small_components(*mask, options_.despeckle, progress.part(0.8, 0.9));
    }
    for (int done = 0; done < options_.halo; done += 8) {  // in steps, to stop in time
        grow(*mask, std::min(8, options_.halo - done), box);
        check_memory(*mask);
    }
    mask->prune();
    keep_ = mask;
}

void MapPasses::prepare(const Progress& progress) {
    const double share = 1.0 / std::max(1, passes_before(options_));
    double done = 0;
    const auto next = [&](int passes) {
        const double from = done;
        done = std::min(1.0, done + share * passes);
        return progress.part(from, done);
    };
    if (wants_statistics(options_)) {
        find_statistics(next(1));
        Statistics& s = *statistics_;
        if (s.count == s.non_finite) throw InvalidInput(name_ + ": the map has no finite sample");
        const bool sigma = options_.normalise == MapReadOptions::Normalise::sigma;
        if (options_.normalise != MapReadOptions::Normalise::none) {
            const double shift = sigma ? s.mean : s.min, spread = sigma ? s.rms : s.max - s.min;
            if (!(spread > 0))
                throw InvalidInput(name_ + ": all samples are equal: they cannot be normalised");
            source_.scale(shift, 1 / spread);
            for (double* v : {&s.min, &s.max, &s.mean}) *v = (*v - shift) / spread;
            s.rms /= spread;
        }
        if (options_.threshold && options_.threshold->kind == ThresholdRule::Kind::sigma)
            sparsify_.threshold = static_cast<float>(s.mean + options_.threshold->number * s.rms);
    }
    if (options_.threshold && options_.threshold->kind == ThresholdRule::Kind::value)
        sparsify_.threshold = static_cast<float>(options_.threshold->number);
    if (wants_percentile(options_)) find_percentile(next(2));
    if (options_.quantise) {
        const bool sigma = options_.quantise->kind == ThresholdRule::Kind::sigma;
        sparsify_.quantisation =
            quantisation_step(options_.quantise->number * (sigma ? statistics_->rms : 1));
    }
    sparsify_.check();
    if (options_.needs_selection()) select(next(1));
    sorter_ = std::make_unique<StripSorter>(size_, source_.order(), sparsify_, keep_.get());
}

std::string MapPasses::history() const {
    const MapReadOptions& o = options_;
    std::string line = "read " + file_;
    if (o.crop) {
        std::string ranges;
        for (std::size_t a = 0; a < 3; ++a)
            ranges += fmt::format("{}{}:{}", a ? "," : "",
                                  o.crop->begin[a] ? std::to_string(*o.crop->begin[a]) : "",
                                  o.crop->end[a] ? std::to_string(*o.crop->end[a]) : "");
        line += " cropped " + ranges;
    }
    if (o.bin > 1) line += fmt::format(" binned {}", o.bin);
    if (o.invert) line += " inverted";
    if (o.normalise == MapReadOptions::Normalise::sigma) line += " normalised sigma";
    if (o.normalise == MapReadOptions::Normalise::range) line += " normalised range";
    if (sparsify_.threshold && sparsify_.band)
        line += fmt::format(" band {} about {}", *sparsify_.band, *sparsify_.threshold);
    else if (sparsify_.threshold)
        line += fmt::format(" threshold {}", *sparsify_.threshold);
    if (sparsify_.background) line += fmt::format(" background {}", *sparsify_.background);
    if (!o.mask.empty()) line += " mask " + o.mask.filename().string();
    if (o.despeckle > 1) line += fmt::format(" despeckle {}", o.despeckle);
    if (o.halo > 0) line += fmt::format(" halo {}", o.halo);
    if (sparsify_.quantisation) line += fmt::format(" quantised {}", *sparsify_.quantisation);
    return line;
}

}  // namespace vdbgeo
