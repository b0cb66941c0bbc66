// One flight of every photon, places taken by append/atomic.glsl.
// Dispatched by src/transport/photons.rs once a bounce. One thread = one incoming path.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"
#include "scene/map_photon.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { FlightPush push; };
layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "math.glsl"
#include "nonfinite_values.glsl"
#include "dispatch.glsl"
#include "philox.glsl"
#include "sampling.glsl"
#include "tally_copy.glsl"
#include "tally.glsl"
#include "append/atomic.glsl"
#include "scene/effects.glsl"
#include "scene/directions.glsl"
#include "scene/bvh.glsl"
#include "scene/surface.glsl"
#include "scene/lobes.glsl"
#include "scene/scatter.glsl"
#include "totals.glsl"
#include "stages/map_store.glsl"
#include "stages/scene_flight.glsl"
#include "stages/scene_trace.glsl"

void main()
{
    scene_trace();
}
