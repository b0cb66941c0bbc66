// What kernels/emit.comp needs of the paper's box.

#include "world/room/walls.glsl"
#include "world/room/photon_push.glsl"

layout(push_constant, scalar) uniform Push { EmitPush push; };
layout(set = 0, binding = 1, scalar) readonly buffer Walls { Wall walls[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { uvec4 next_paths[]; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/rng.glsl"
#include "rng/sampling.glsl"
#include "world/room/disc.glsl"
#include "world/room/photon_state.glsl"
#include "world/room/emit.glsl"

uint photon_count()
{
    return push.range.count;
}

void write_photon(uint index)
{
    uvec4[PATH_WORDS] words = pack_path(leave_light(index, push.range));
    for (uint k = 0; k < PATH_WORDS; k++) {
        next_paths[path_word(k, push.path_offset + index, push.path_capacity)] = words[k];
    }
}
