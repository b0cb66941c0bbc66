// Counts the digits of a pass of the radix sort of index/tree_digits.glsl.
// Dispatched by src/engine/room/index/tree.rs once a digit. One thread = a run of TREE_RUN photons.
// After it tree_counts[d * runs + r] = photons of run r with the digit d.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { TreePush push; };
#include "world/room/photon.glsl"
#include "index/photon_list.glsl"
#include "index/tree_digits.glsl"
layout(set = 1, binding = 3, scalar) writeonly buffer TreeCounts { uint tree_counts[]; };

#include "dispatch/dispatch.glsl"

void main()
{
    uint length = photon_list_length(push.photon_capacity);
    uint runs = run_count(length);
    uint run = invocation_index();
    if (run >= runs) {
        return;
    }
    uint found[TREE_RADIX];
    for (uint digit = 0; digit < TREE_RADIX; digit++) {
        found[digit] = 0;
    }
    uint end = min((run + 1) * TREE_RUN, length);
    for (uint i = run * TREE_RUN; i < end; i++) {
        found[digit_of(keys[i])]++;
    }
    for (uint digit = 0; digit < TREE_RADIX; digit++) {
        tree_counts[digit * runs + run] = found[digit];
    }
}
