// The rate of atomic additions whose answer is used, at random counters up to number `mask`, or with mask 0 at one.
// Dispatched by src/measure/bench/rates.rs. One thread = `step_count` additions.
#extension GL_EXT_scalar_block_layout : require

#include "check/measure_push.glsl"

layout(push_constant, scalar) uniform Push { MeasurePush push; };
layout(set = 1, binding = 0, scalar) buffer Counts { uint counts[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sums { uint sums[]; };

#include "dispatch/dispatch.glsl"
#include "check/measured_place.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.item_count) {
        return;
    }
    uint sum = 0;
    for (uint step = 0; step < push.step_count; step++) {
        sum += atomicAdd(counts[measured_place(index * push.step_count + step) & push.mask], 1);
    }
    sums[index] = sum;
}
