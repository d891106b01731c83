#include "tests/bench/bench_input.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "converters/mrc.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_builder.h"
#include "vdbgeo/volume/phantom.h"

namespace vdbgeo::bench {

Source phantom_source(const std::string& kind, int size, std::optional<double> snr) {
    PhantomOptions options;
    options.kind = kind;
    options.size = size;
    options.snr = snr;
    const auto phantom = std::make_shared<Phantom>(options);
    const std::string noise = snr ? fmt::format("-snr{}", *snr) : "";
    return {fmt::format("{}{}{}", kind, size, noise), phantom->frame(), phantom->isovalue(),
            [phantom](int z0, int z1, float* out) { phantom->sections(z0, z1, out); }};
}

Source mrc_source(const std::string& path) {
    const auto reader = std::make_shared<MrcReader>(path);
    if (reader->order() != std::array<int, 3>{0, 1, 2})
        throw InvalidInput(path + ": only maps with columns along x and sections along z are benchmarked");
    return {std::filesystem::path(path).filename().string(),
            reader->frame(),
            {},
            [reader](int z0, int z1, float* out) { reader->read_sections(out, z1 - z0); }};
}

Inputs make_inputs(const Source& source, bool dense, bool all, std::optional<float> threshold) {
    const Vec3i size = source.frame.size;
    const std::size_t section = source.section_size();
    GridBuilder all_builder(size, {0, 1, 2});
    SparsifyOptions sparse;
    sparse.threshold = threshold;
    GridBuilder active_builder(size, {0, 1, 2}, sparse);
    Inputs inputs;
    if (dense) inputs.dense.resize(section * static_cast<std::size_t>(size.z()));
    std::vector<float> slab(section * GridBuilder::slab);
    for (int z = 0; z < size.z(); z += GridBuilder::slab) {
        const int count = std::min(GridBuilder::slab, size.z() - z);
        source.sections(z, z + count, slab.data());
        const auto begin = slab.begin(), end = begin + static_cast<std::ptrdiff_t>(section) * count;
        if (dense) std::copy(begin, end, inputs.dense.begin() + static_cast<std::ptrdiff_t>(section) * z);
        if (all) all_builder.add_sections(slab.data(), count);
        if (threshold) active_builder.add_sections(slab.data(), count);
    }
    if (all) inputs.all = all_builder.finish(source.frame);
    if (threshold) inputs.active = active_builder.finish(source.frame);
    return inputs;
}

std::pair<std::uint64_t, std::uint64_t> count_leaves(const DensityMap& map, float isovalue) {
    std::uint64_t leaves = 0, crossed = 0;
    for (auto leaf = map.grid->tree().cbeginLeaf(); leaf; ++leaf) {
        bool below = false, above = false;
        for (auto value = leaf->cbeginValueAll(); value; ++value) (*value >= isovalue ? above : below) = true;
        ++leaves;
        crossed += below && above;
    }
    return {leaves, crossed};
}

}  // namespace vdbgeo::bench
