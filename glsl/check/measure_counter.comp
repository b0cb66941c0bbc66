// The rate of additions to one counter, one per subgroup, whose answer all its invocations use.
// Dispatched by src/measure/bench/rates.rs. One thread = `step_count` additions by its subgroup.
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_scalar_block_layout : require

#include "check/measure_push.glsl"

layout(push_constant, scalar) uniform Push { MeasurePush push; };
layout(set = 1, binding = 0, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sums { uint sums[]; };

#include "dispatch/dispatch.glsl"
#include "builder/place.glsl"

void main()
{
    uint index = invocation_index();
    uint sum = 0;
    for (uint step = 0; step < push.step_count; step++) {
        sum += take_place(0, index < push.item_count);
    }
    if (index < push.item_count) {
        sums[index] = sum;
    }
}
