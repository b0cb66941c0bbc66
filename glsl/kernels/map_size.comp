// Length of a map: the size of the dispatches that index it, and what it adds to the photons stored.
// Dispatched by src/transport/photons.rs once a map that is indexed, as one thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { DispatchSizePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sizes { DispatchArgs dispatch_args[]; };

#include "dispatch/dispatch.glsl"
#include "dispatch/dispatch_size.glsl"
#include "ledger/totals.glsl"

void main()
{
    uint stored = min(counters[push.counter], push.capacity);
    dispatch_args[0] = dispatch_size(stored, push.items_per_group, push.max_groups);
    if (totals[TOTAL_STORED] > 0xffffffffu - stored) {
        totals[TOTAL_STORED + 1]++;
    }
    totals[TOTAL_STORED] += stored;
}
