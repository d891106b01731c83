// Keeps the ghosts of a share up to date: bricks that others own and the operators of this member read.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "vdbgeo/stencil/share.h"

namespace vdbgeo::stencil {

/// Bricks go from their owners to those that have them as ghosts, a message for each slab and member. A slab
/// can be sent as soon as it is done, and ghosts are waited for when a slab beside them is begun: as a sweep
/// goes to and fro, what it makes first is what the next one needs last.
///
/// Bytes of one exchange of f fields: 2048 f for every leaf with active voxels of the own box in another's
/// halo.
class GhostExchange {
 public:
    /// Both have to live as long.
    GhostExchange(const BlockLayout& layout, const Share& share);

    /// Begins a round: ghosts of so many fields will come, of all slabs. Those of the round before may still
    /// have to be filled in.
    void begin(std::size_t fields);
    /// Sends what others need of a slab, in the round that has begun.
    void send(std::size_t slab, const std::vector<const float*>& fields);
    /// Writes the ghosts of this slab and of those beside it into the fields, as they came in the round
    /// before; nothing where that was done. Waits for them.
    void fill_around(std::size_t slab, const std::vector<float*>& fields);
    /// All ghosts that are still to come in the round that has begun.
    void fill_all(const std::vector<float*>& fields);
    /// A whole round at once.
    void run(const std::vector<float*>& fields);

    std::uint64_t bytes_sent() const { return bytes_sent_; }

 private:
    /// Bricks of one slab that go to, or come from, one member.
    struct Piece {
        int member = 0;
        std::vector<std::int32_t> bricks;
    };
    struct Slab {
        int tag = 0, round = 0;  ///< round that `coming` belongs to
        std::vector<Piece> out, in;
        std::vector<std::unique_ptr<Team::Incoming>> coming;  ///< by `in`; empty once filled in
    };
    void add(std::vector<Piece>& pieces, int member, std::size_t brick);
    void expect(Slab& slab);
    void fill(Slab& slab, int round, const std::vector<float*>& fields);

    Team& team_;
    std::vector<Slab> slabs_;
    int round_ = 0;
    std::size_t fields_ = 0;  ///< of the round
    std::uint64_t bytes_sent_ = 0;
};

}  // namespace vdbgeo::stencil
