// Writes each photon of a map to its place in bucket order, and adds their number to the photons stored.
// Dispatched by src/engine/scene/index.rs once a chunk and grid. One thread = half a photon, twice.
// cells[b] = first place of bucket b; ranks from map_count.comp.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { CellPush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Map { uvec4 map[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 2, scalar) readonly buffer Cells { uint cells[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer SortedMap { uvec4 sorted_map[]; };
layout(set = 1, binding = 4, scalar) readonly buffer Ranks { uint ranks[]; };

layout(constant_id = 5) const bool HAS_SLOTS = false;

#include "dispatch/dispatch.glsl"
#include "ledger/totals.glsl"
#include "index/buckets.glsl"

void main()
{
    // Behind the last bucket stands the number of all photons.
    if (invocation_index() == 0 && push.counts_stored != 0) {
        uint stored = cells[push.bucket_mask + 1];
        if (totals[TOTAL_STORED] > 0xffffffffu - stored) {
            totals[TOTAL_STORED + 1]++;
        }
        totals[TOTAL_STORED] += stored;
    }
    // Two neighbours move a photon, a half each: a half written alone would cost memory as much as the whole.
    for (uint sweep = 0; sweep < 2; sweep++) {
        uint item = (2 * work_group_index() + sweep) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        uint index = item / 2;
        bool is_there = index < min(counters[0], push.photon_capacity);
        if (HAS_SLOTS && is_there) {
            is_there = map[2 * index].w != NONE;
        }
        if (is_there) {
            uint bucket = bucket_of(cell_at(uintBitsToFloat(map[2 * index].xyz), push), push);
            sorted_map[2 * (cells[bucket] + ranks[index]) + item % 2] = map[item];
        }
    }
}
