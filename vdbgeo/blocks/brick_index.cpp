#include "vdbgeo/blocks/brick_index.h"

#include <algorithm>
#include <tuple>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using stencil::BlockField;
using stencil::BlockLayout;

constexpr std::size_t brick_bytes = BlockField::brick_size * sizeof(float);
constexpr std::size_t chunk = 512;  // bricks: a megabyte, enough for a disk, and many of them for many threads
constexpr std::size_t files = 8;    // which have the chunks in turn

auto key(const Coord& cell) { return std::make_tuple(cell.y(), cell.z(), cell.x()); }

bool has(const std::array<std::uint64_t, 4>& bits, std::size_t i) { return bits[i / 64] >> (i % 64) & 1; }

Coord place_in_cell(std::size_t slot) {
    const int s = static_cast<int>(slot), z = s % BlockLayout::leaves_z,
              y = s / BlockLayout::leaves_z % BlockLayout::leaves_y,
              x = s / (BlockLayout::leaves_z * BlockLayout::leaves_y);
    return {8 * x, 8 * y, 8 * z};
}

CoordBBox box_of(const Coord& cell) {
    return {cell, cell.offsetBy(BlockLayout::size_x - 1, BlockLayout::size_y - 1, BlockLayout::size_z - 1)};
}

}  // namespace

int BrickIndex::Cell::count() const {
    int n = 0;
    for (const std::uint64_t bits : leaves) n += __builtin_popcountll(bits);
    return n;
}

void BrickIndex::add(const BlockLayout& part) {
    for (const BlockLayout::Cell& from : part.cells()) {
        if (!from.own) continue;
        Cell cell;
        cell.origin = from.origin;
        cell.first_mask = static_cast<std::uint32_t>(masks_.size());
        for (std::size_t i = 0; i < from.bricks.size(); ++i) {
            if (from.bricks[i] == BlockLayout::none) continue;
            const auto brick = static_cast<std::size_t>(from.bricks[i]);
            cell.leaves[i / 64] |= std::uint64_t(1) << (i % 64);
            if (part.full(brick)) continue;
            cell.partial[i / 64] |= std::uint64_t(1) << (i % 64);
            masks_.push_back(part.mask(brick));
        }
        cells_.push_back(cell);
    }
}

void BrickIndex::finish() {
    std::sort(cells_.begin(), cells_.end(),
              [](const Cell& a, const Cell& b) { return key(a.origin) < key(b.origin); });
    bricks_ = 0;
    for (Cell& cell : cells_) {
        cell.first_brick = bricks_;
        bricks_ += static_cast<std::uint64_t>(cell.count());
    }
}

std::size_t BrickIndex::memory() const {
    return cells_.capacity() * sizeof(Cell) + masks_.capacity() * sizeof(BlockLayout::Mask);
}

namespace {

void add_brick(std::uint64_t brick, std::size_t at, std::vector<BrickIndex::Run>& runs) {
    if (!runs.empty()) {
        BrickIndex::Run& last = runs.back();
        if (last.first + last.count == brick && last.at + last.count == at && brick % chunk != 0) {
            ++last.count;
            return;
        }
    }
    runs.push_back({brick, at, 1});
}

}  // namespace

BrickIndex::Part BrickIndex::part(const CoordBBox& box) const {
    BlockLayout::Mask full;
    full.fill(~std::uint64_t(0));
    Part out;
    for (const Cell& cell : cells_) {
        if (!box.hasOverlap(box_of(cell.origin))) continue;
        std::uint64_t brick = cell.first_brick;
        std::size_t mask = cell.first_mask;
        for (std::size_t i = 0; i < 64 * cell.leaves.size(); ++i) {
            if (!has(cell.leaves, i)) continue;
            const bool partial = has(cell.partial, i);
            const Coord origin = cell.origin + place_in_cell(i);
            if (box.isInside(origin)) {
                add_brick(brick, out.leaves.size(), out.runs);
                out.leaves.push_back({origin, partial ? masks_[mask] : full});
            }
            ++brick;
            mask += partial;
        }
    }
    return out;
}

std::vector<BrickIndex::Run> BrickIndex::within(const Part& part, const CoordBBox& box) {
    std::vector<Run> out;
    for (const Run& run : part.runs)
        for (std::size_t i = 0; i < run.count; ++i)
            if (box.isInside(part.leaves[run.at + i].origin)) add_brick(run.first + i, run.at + i, out);
    return out;
}

BrickFile::BrickFile(const std::filesystem::path& folder) {
    for (std::size_t i = 0; i < files; ++i) files_.push_back(std::make_unique<ScratchFile>(folder));
}

namespace {

std::size_t file_of(std::uint64_t brick) { return brick / chunk % files; }
std::uint64_t place_in_file(std::uint64_t brick) {
    return (brick / chunk / files * chunk + brick % chunk) * brick_bytes;
}

}  // namespace

void BrickFile::read(const std::vector<BrickIndex::Run>& runs, float* field) const {
    parallel_for(runs.size(), 1, [&](std::size_t i) {
        const BrickIndex::Run& run = runs[i];
        files_[file_of(run.first)]->read(place_in_file(run.first), field + run.at * BlockField::brick_size,
                                         run.count * brick_bytes);
    });
}

void BrickFile::write(const std::vector<BrickIndex::Run>& runs, const float* field) {
    parallel_for(files, 1, [&](std::size_t file) {
        for (const BrickIndex::Run& run : runs)
            if (file_of(run.first) == file)
                files_[file]->write(place_in_file(run.first), field + run.at * BlockField::brick_size,
                                    run.count * brick_bytes);
    });
}

}  // namespace vdbgeo
