// Exclusive prefix sum inside blocks of group size * SCAN_ITEMS items, and the sum of each block.
// Dispatched by src/engine/prefix_sum.rs once a level. One thread = SCAN_ITEMS neighbouring items.
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { ScanPush push; };
layout(set = 1, binding = 0, scalar) buffer Items { uint items[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer BlockSums { uint block_sums[]; };

#include "dispatch/dispatch.glsl"

shared uint subgroup_sums[MAX_SUBGROUPS];

void main()
{
    uint first = invocation_index() * SCAN_ITEMS;
    uint item[SCAN_ITEMS];
    uint thread_sum = 0;
    for (uint k = 0; k < SCAN_ITEMS; k++) {
        item[k] = first + k < push.item_count ? items[first + k] : 0;
        thread_sum += item[k];
    }
    uint before_in_subgroup = subgroupExclusiveAdd(thread_sum);
    uint subgroup_sum = subgroupAdd(thread_sum);
    if (subgroupElect()) {
        subgroup_sums[gl_SubgroupID] = subgroup_sum;
    }
    barrier();
    uint before = before_in_subgroup;
    uint block_sum = 0;
    for (uint s = 0; s < gl_NumSubgroups; s++) {
        before += s < gl_SubgroupID ? subgroup_sums[s] : 0;
        block_sum += subgroup_sums[s];
    }
    for (uint k = 0; k < SCAN_ITEMS; k++) {
        if (first + k < push.item_count) {
            items[first + k] = before;
        }
        before += item[k];
    }
    if (gl_LocalInvocationIndex == 0 && first < push.item_count) {
        block_sums[work_group_index()] = block_sum;
    }
}
