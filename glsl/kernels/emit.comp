// Emission of a run of photons from one disc light.
// Dispatched by src/trace.rs once a light and chunk. One thread = one photon.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { EmitPush push; };
layout(set = 0, binding = 1, scalar) readonly buffer Walls { Wall walls[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Paths { Path paths[]; };

#include "math.glsl"
#include "oddities.glsl"
#include "dispatch.glsl"
#include "rng.glsl"
#include "sampling.glsl"
#include "emission.glsl"
#include "stages/leave_light.glsl"

void main()
{
    uint index = invocation_index();
    if (index < push.range.count) {
        paths[push.path_offset + index] = leave_light(index, push.range);
    }
}
