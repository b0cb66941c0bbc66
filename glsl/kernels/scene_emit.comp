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

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"
#include "rng/sampling.glsl"
#include "world/scene/effects.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "material/surface.glsl"
#include "world/scene/areas.glsl"
#include "world/scene/lights.glsl"
#include "world/scene/aim.glsl"
#include "world/scene/emit.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= push.emission.photon_count) {
        return;
    }
    light_paths[index] = emit_photon(push.emission.first_photon + index, push.draws, push.emission);
}
