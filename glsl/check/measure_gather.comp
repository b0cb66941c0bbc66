// The rate of reads of 32 bytes, a record's size, at random places of a large buffer.
// Dispatched by src/measure/bench/rates.rs. One thread = `step_count` reads, at pairs of blocks up to number `mask`.
#extension GL_EXT_scalar_block_layout : require

#include "check/measure_push.glsl"

layout(push_constant, scalar) uniform Push { MeasurePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Blocks { uvec4 blocks[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sums { uint sums[]; };

#include "dispatch/dispatch.glsl"
#include "check/measured_place.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.item_count) {
        return;
    }
    uvec4 sum = uvec4(0);
    for (uint step = 0; step < push.step_count; step++) {
        uint pair = measured_place(index * push.step_count + step) & push.mask;
        sum += blocks[2 * pair] ^ blocks[2 * pair + 1];
    }
    sums[index] = sum.x + sum.y + sum.z + sum.w;
}
