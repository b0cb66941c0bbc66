// One flight of every photon, places taken by builder/atomic.glsl.
// Dispatched by src/transport/photons.rs once a bounce. One thread = one incoming path.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"
#include "world/scene/photon.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { FlightPush push; };
layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"
#include "rng/sampling.glsl"
#include "ledger/tally_copy.glsl"
#include "ledger/tally.glsl"
#include "builder/atomic.glsl"
#include "world/scene/effects.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "material/surface.glsl"
#include "material/lobes.glsl"
#include "material/scatter.glsl"
#include "ledger/totals.glsl"
#include "world/scene/store.glsl"
#include "world/scene/step.glsl"
#include "builder/scene_trace.glsl"

void main()
{
    scene_trace();
}
