// Emission of a run of photons from one disc light.
// Dispatched by src/trace.rs once a light and chunk. One thread = one photon.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { EmitPush push; };
layout(set = 0, binding = 0, scalar) readonly buffer Lights { DiscLight lights[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Walls { Wall walls[]; };
layout(set = 1, binding = 0, scalar) readonly buffer StreamSeeds { uvec2 stream_seeds[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Paths { Path paths[]; };

#include "math.glsl"
#include "oddities.glsl"
#include "dispatch.glsl"
#include "rng.glsl"
#include "sampling.glsl"
#include "emission.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.photon_count) {
        return;
    }
    uint photon = push.first_photon + index;
    DiscLight light = lights[push.light];
    uvec2 start = uvec2(push.first_sample + index, push.light);
    if (RNG == RNG_RAND48) {
        start = affine48(stream_seeds[index], push.jump_multiplier, push.jump_increment);
    }
    uvec2 stream = open_stream(push.key, photon, start);
    vec4 u = draw_emission(push.key, photon, stream);
    vec3 position;
    vec3 direction;
    emit_from_disc(light, walls[light.wall], u, position, direction);
    note_unless(is_finite(position) && is_finite(direction) && is_finite(light.flux), ODD_PHOTON, DOMAIN_PHOTONS, push.key.round, photon);
    paths[push.path_offset + index] = Path(position, light.wall, direction, photon, stream, light.flux);
}
