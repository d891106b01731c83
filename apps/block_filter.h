// What commands share that make a map out of a map which does not fit into the memory that may be taken.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "apps/flow_flags.h"
#include "apps/map_filter.h"
#include "vdbgeo/blocks/blocked_map.h"

namespace vdbgeo::app {

/// Whether the map is to be filtered block by block: a folder of parts, or a map file of which all samples,
/// as its header tells them, would take more than --memory. Samples that a threshold keeps count as all where
/// --memory is given; else they are counted once they are read.
bool in_blocks(const MapFilterFlags& flags, const MemoryNeed& need);

/// What is made of a map, and how it is noted.
struct BlockedCommand {
    std::string stage;
    /// The computation; null where no sample is kept.
    std::function<std::unique_ptr<BlockedResult>(const MapSource&, const BlockOptions&, HyperdiffusionReport&,
                                                 const Progress&)>
        compute;
    std::function<std::string(const HyperdiffusionReport&)> history;
    const CheckpointFlags* checkpoints = nullptr;
    bool cleared = false;  ///< clear_inactive
};

struct BlockedOutcome {
    HyperdiffusionReport report;
    Statistics statistics;  ///< of the new map
    double deviation = 0;   ///< of the values there were
    Json result;            ///< filter_result, statistics_json, what there is to say of the file
    Json seconds;           ///< read, compute, write
};

/// Reads the map block by block, computes, and writes what comes out.
BlockedOutcome filter_in_blocks(const MapFilterFlags& flags, const BlockedCommand& command, Session& session);

}  // namespace vdbgeo::app
