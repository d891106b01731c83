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
    /// Lets messages move on: to be called now and then by the team's thread while others, or it, compute.
    void move() { team_.move_messages(); }
    /// A whole round at once.
    void run(const std::vector<float*>& fields);

    std::uint64_t bytes_sent() const { return bytes_sent_; }

 private:
    /// Bricks of one slab that go to, or come from, one member.
    struct Piece {
        int member = 0;
        std::vector<std::int32_t> bricks;
        std::unique_ptr<Team::Outgoing> out;
        std::unique_ptr<Team::Incoming> in;
    };
    struct Slab {
        int tag = 0;
        std::vector<Piece> out, in;
        int round = 0;         ///< the one whose ghosts are to come
        bool expects = false;  ///< they were not filled in yet
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
