// Emission of a run of photons from one disc light.
// Dispatched by src/trace.rs once a light and chunk. One thread = one photon.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { EmitPush push; };
layout(set = 0, binding = 1, scalar) readonly buffer Walls { Wall walls[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Paths { uvec4 paths[]; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/rng.glsl"
#include "rng/sampling.glsl"
#include "world/room/emission.glsl"
#include "world/room/path.glsl"
#include "world/room/emit.glsl"

void main()
{
    uint index = invocation_index();
    if (index < push.range.count) {
        uvec4[PATH_WORDS] words = pack_path(leave_light(index, push.range));
        for (uint k = 0; k < PATH_WORDS; k++) {
            paths[path_word(k, push.path_offset + index, push.path_capacity)] = words[k];
        }
    }
}
