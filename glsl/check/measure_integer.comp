// The rate of 32-bit multiplications, and with one step the content of the buffer that the other measurements move:
// Philox on itself, `step_count` times.
// Dispatched by src/measure/bench/rates.rs. One thread = one block of four words, whose counter begins with its number.
#extension GL_EXT_scalar_block_layout : require

#include "check/measure_push.glsl"

layout(push_constant, scalar) uniform Push { MeasurePush push; };
layout(set = 1, binding = 0, scalar) writeonly buffer Blocks { uvec4 blocks[]; };

#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.item_count) {
        return;
    }
    uvec4 block = uvec4(index, 0, 0, 0);
    for (uint step = 0; step < push.step_count; step++) {
        block = philox(block, uvec2(0));
    }
    blocks[index] = block;
}
