// Adds what stands before each block to the block's own prefix sums.
// Dispatched by src/engine/prefix_sum.rs once a level. One thread = SCAN_ITEMS neighbouring items.
// `block_sums` holds exclusive prefix sums by now.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { ScanPush push; };
layout(set = 1, binding = 0, scalar) buffer Items { uint items[]; };
layout(set = 1, binding = 1, scalar) readonly buffer BlockSums { uint block_sums[]; };

#include "dispatch/dispatch.glsl"

void main()
{
    uint block = work_group_index();
    uint first = invocation_index() * SCAN_ITEMS;
    for (uint k = 0; k < SCAN_ITEMS; k++) {
        if (first + k < push.item_count) {
            items[first + k] += block_sums[block];
        }
    }
}
