#include "vdbgeo/blocks/block_marching_cubes.h"

#include <algorithm>

#include "vdbgeo/core/freed_memory.h"

namespace vdbgeo {

using openvdb::Coord;

BlockMarchingCubes::BlockMarchingCubes(ReadBox read, const BlockLattice& lattice,
                                       const MarchingCubesOptions& options, const Progress& progress)
    : read_(std::move(read)),
      lattice_(lattice),
      isovalue_(static_cast<float>(options.isovalue)),
      crossed_(lattice.size(), 0) {
    options.check();
    std::vector<SurfaceColumn> columns;
    const double count = static_cast<double>(lattice_.size());
    for (std::size_t n = 0; n < lattice_.size(); ++n) {
        const double before = static_cast<double>(n) / count;
        last_.reset();
        give_memory_back();
        last_.emplace(read_part(n, progress.part(before, before + 1 / count)));
        leaves_ += last_->map.grid->constTree().leafCount();
        const std::vector<SurfaceColumn> found = last_->surface.columns();
        crossed_[n] = !found.empty();
        columns.insert(columns.end(), found.begin(), found.end());
    }
    numbers_.emplace(std::move(columns));
}

BlockMarchingCubes::Part BlockMarchingCubes::read_part(std::size_t n, const Progress& progress) const {
    DensityMap map = read_(lattice_.wanted(n), progress.part(0, 0.7));
    SurfacePart surface(map, isovalue_, lattice_.without_border(n), progress.part(0.7, 1));
    return {std::move(map), std::move(surface)};
}

/// What the upper neighbours of a block told of their borders.
std::vector<BorderBlock> BlockMarchingCubes::above(std::size_t n) const {
    std::vector<BorderBlock> all;
    for (int side = 1; side < 8; ++side) {
        const Coord at = lattice_.place(n) + Coord(side & 1, side >> 1 & 1, side >> 2 & 1);
        if (at.x() >= lattice_.count().x() || at.y() >= lattice_.count().y() ||
            at.z() >= lattice_.count().z())
            continue;
        const auto found = border_.find(lattice_.at(at));
        if (found != border_.end()) all.insert(all.end(), found->second.begin(), found->second.end());
    }
    return all;
}

/// Blocks are filled from the last to the first; what all lower neighbours of a block have taken goes.
void BlockMarchingCubes::keep_border(std::size_t n, const SurfacePart& surface) {
    border_[n] = surface.border();
    for (auto kept = border_.begin(); kept != border_.end();) {
        const Coord at = lattice_.place(kept->first);
        const Coord last(std::max(at.x() - 1, 0), std::max(at.y() - 1, 0), std::max(at.z() - 1, 0));
        kept = lattice_.at(last) >= n ? border_.erase(kept) : std::next(kept);
    }
}

void BlockMarchingCubes::fill(std::size_t bytes, const std::function<void(const SurfacePiece&)>& take,
                              const Progress& progress) {
    const double count = static_cast<double>(lattice_.size());
    for (std::size_t n = lattice_.size(); n-- > 0;) {
        const double before = 1 - static_cast<double>(n + 1) / count;
        const Progress here = progress.part(before, before + 1 / count);
        if (!crossed_[n]) last_.reset();
        if (!last_ && crossed_[n]) last_.emplace(read_part(n, here.part(0, 0.5)));
        if (last_) {
            last_->surface.number(*numbers_, above(n));
            last_->surface.fill(bytes, take, here.part(0.5, 1));
            keep_border(n, last_->surface);
        }
        last_.reset();
        give_memory_back();
        here.report(1);
    }
    border_.clear();
}

}  // namespace vdbgeo
