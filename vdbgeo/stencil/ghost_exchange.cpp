#include "vdbgeo/stencil/ghost_exchange.h"

#include <algorithm>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo::stencil {
namespace {

constexpr std::size_t brick_size = BlockField::brick_size;
constexpr int tags = 16384;  // MPI promises 32767

}  // namespace

GhostExchange::GhostExchange(const BlockLayout& layout, const Share& share) : team_(*share.team) {
    std::vector<openvdb::CoordBBox> reach;
    for (int r = 0; r < team_.size(); ++r) reach.push_back(share.with_ghosts(r));
    const auto owner = [&](const openvdb::Coord& leaf) {
        const auto box = std::find_if(share.boxes.begin(), share.boxes.end(),
                                      [&](const openvdb::CoordBBox& b) { return b.isInside(leaf); });
        if (box == share.boxes.end()) throw InvalidInput("a leaf of the grid lies in no member's box");
        return static_cast<int>(box - share.boxes.begin());
    };
    for (const BlockLayout::Slab& s : layout.slabs()) {
        Slab slab;
        const int y = layout.cells()[s.first_cell].origin.y() / BlockLayout::size_y;
        slab.tag = (y % tags + tags) % tags;
        for (std::size_t b = s.begin; b < s.end; ++b) {
            const openvdb::Coord& at = layout.origin(b);
            if (!share.own().isInside(at)) {
                add(slab.in, owner(at), b);
                continue;
            }
            const openvdb::CoordBBox leaf(at, at.offsetBy(7));
            for (int r = 0; r < team_.size(); ++r)
                if (r != team_.rank() && reach[static_cast<std::size_t>(r)].hasOverlap(leaf))
                    add(slab.out, r, b);
        }
        for (Piece& piece : slab.out) piece.out = team_.outgoing(piece.member, slab.tag);
        for (Piece& piece : slab.in) piece.in = team_.incoming(piece.member, slab.tag);
        slabs_.push_back(std::move(slab));
    }
}

/// The layout's order of bricks is that of their places, so both sides list them alike.
void GhostExchange::add(std::vector<Piece>& pieces, int member, std::size_t brick) {
    auto piece =
        std::find_if(pieces.begin(), pieces.end(), [&](const Piece& p) { return p.member == member; });
    if (piece == pieces.end()) {
        piece = pieces.emplace(piece);
        piece->member = member;
    }
    piece->bricks.push_back(static_cast<std::int32_t>(brick));
}

void GhostExchange::expect(Slab& slab) {
    slab.round = round_;
    slab.expects = !slab.in.empty();
    for (const Piece& piece : slab.in) piece.in->expect(fields_ * piece.bricks.size() * brick_size);
}

void GhostExchange::begin(std::size_t fields) {
    ++round_;
    fields_ = fields;
    for (Slab& slab : slabs_)
        if (!slab.expects) expect(slab);
}

void GhostExchange::send(std::size_t slab, const std::vector<const float*>& fields) {
    for (const Piece& piece : slabs_[slab].out) {
        const std::size_t count = piece.bricks.size(), values = fields.size() * count * brick_size;
        float* const to = piece.out->buffer(values);
        parallel_for(fields.size() * count, 32, [&](std::size_t i) {
            const auto brick = static_cast<std::size_t>(piece.bricks[i % count]);
            std::copy_n(fields[i / count] + brick * brick_size, brick_size, to + i * brick_size);
        });
        bytes_sent_ += values * sizeof(float);
        piece.out->send();
    }
    move();
}

void GhostExchange::fill(Slab& slab, int round, const std::vector<float*>& fields) {
    if (!slab.expects || slab.round > round) return;
    for (const Piece& piece : slab.in) {
        const float* const from = piece.in->take();
        const std::size_t count = piece.bricks.size();
        parallel_for(fields.size() * count, 32, [&](std::size_t i) {
            const auto brick = static_cast<std::size_t>(piece.bricks[i % count]);
            std::copy_n(from + i * brick_size, brick_size, fields[i / count] + brick * brick_size);
        });
    }
    slab.expects = false;
    if (slab.round < round_) expect(slab);
}

void GhostExchange::fill_around(std::size_t slab, const std::vector<float*>& fields) {
    for (std::size_t s = slab > 0 ? slab - 1 : 0; s < std::min(slab + 2, slabs_.size()); ++s)
        fill(slabs_[s], round_ - 1, fields);
}

void GhostExchange::fill_all(const std::vector<float*>& fields) {
    for (Slab& slab : slabs_) fill(slab, round_, fields);
}

void GhostExchange::run(const std::vector<float*>& fields) {
    begin(fields.size());
    for (std::size_t s = 0; s < slabs_.size(); ++s) send(s, {fields.begin(), fields.end()});
    fill_all(fields);
}

}  // namespace vdbgeo::stencil
