// The bandwidth of memory: 16 bytes an invocation from one buffer to another.
// Dispatched by src/measure/bench/rates.rs. One thread = one block.
#extension GL_EXT_scalar_block_layout : require

#include "check/measure_push.glsl"

layout(push_constant, scalar) uniform Push { MeasurePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Blocks { uvec4 blocks[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Copies { uvec4 copies[]; };

#include "dispatch/dispatch.glsl"

void main()
{
    uint index = invocation_index();
    if (index < push.item_count) {
        copies[index] = blocks[index];
    }
}
