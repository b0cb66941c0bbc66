// Counts the photons of each bucket of a map, and numbers them in it.
// Dispatched by src/engine/scene/index.rs once a chunk and grid. One thread = one photon.
// After it cells[b] = photons in bucket b; ranks[i] = photons that came to the bucket of photon i before it. That order
// varies from run to run; the integer sums of the lookup do not see it.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { CellPush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Map { uvec4 map[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 2, scalar) buffer Cells { uint cells[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer Ranks { uint ranks[]; };

layout(constant_id = 5) const bool HAS_SLOTS = false;

#include "dispatch/dispatch.glsl"
#include "index/buckets.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= min(counters[0], push.photon_capacity)) {
        return;
    }
    uvec4 place = map[2 * index];
    if (!HAS_SLOTS || place.w != NONE) {
        ranks[index] = atomicAdd(cells[bucket_of(cell_at(uintBitsToFloat(place.xyz), push), push)], 1);
    }
}
