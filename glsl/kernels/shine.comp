// Photons as they leave the lights of a scene.
// Dispatched by src/transport/photons.rs once a chunk. One thread = one photon.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { EmissionPush push; };
layout(set = 1, binding = 0, scalar) writeonly buffer LightPaths { LightPath light_paths[]; };

#include "math.glsl"
#include "oddities.glsl"
#include "dispatch.glsl"
#include "philox.glsl"
#include "sampling.glsl"
#include "scene/effects.glsl"
#include "scene/directions.glsl"
#include "scene/bvh.glsl"
#include "scene/surface.glsl"
#include "scene/areas.glsl"
#include "scene/lights.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.photon_count) {
        return;
    }
    uint photon = push.first_photon + index;
    vec4 u = philox_floats(uvec4(photon, push.draws.round, 0, push.draws.domain), push.draws.seed);
    vec4 w = philox_floats(uvec4(photon, push.draws.round, 1, push.draws.domain), push.draws.seed);
    Emission emission = sample_emission(push.emitter_count, push.scene_radius, u, w);
    note_unless(is_finite(emission.position) && is_finite(emission.direction) && is_finite(emission.flux), ODD_PHOTON,
                push.draws.domain, push.draws.round, photon);
    light_paths[index] = LightPath(emission.position, photon, emission.direction, ARRIVED_DIRECT, emission.flux);
}
