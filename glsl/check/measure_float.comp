// The rate of single-precision sums and products, each rounded by itself as everywhere else here.
// Dispatched by src/measure/bench/rates.rs. One thread = four points that turn around the origin, which neither settle nor
// wait for each other; a step takes 16 sums and products.
#extension GL_EXT_scalar_block_layout : require

#include "check/measure_push.glsl"

layout(push_constant, scalar) uniform Push { MeasurePush push; };
layout(set = 1, binding = 0, scalar) writeonly buffer Results { float results[]; };

#include "dispatch/dispatch.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.item_count) {
        return;
    }
    float start = float(index & 1023u);
    vec4 x = vec4(start, start + 1.0, start + 2.0, start + 3.0);
    vec4 y = x + 4.0;
    for (uint step = 0; step < push.step_count; step++) {
        x = x + y * 0.125;
        y = y - x * 0.125;
    }
    results[index] = ((x.x + x.y) + (x.z + x.w)) + ((y.x + y.y) + (y.z + y.w));
}
