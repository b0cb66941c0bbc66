// Photons of a run of one disc light, each from emission to its end.
// Dispatched by src/trace.rs once a light and chunk. One thread = every `stride`th photon.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { TracePersistentPush push; };
layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "math.glsl"
#include "nonfinite_values.glsl"
#include "dispatch.glsl"
#include "rng.glsl"
#include "sampling.glsl"
#include "room.glsl"
#include "bsdf.glsl"
#include "emission.glsl"
#include "tally_copy.glsl"
#include "tallies.glsl"
#include "photon.glsl"
#include "path.glsl"
#include "append/ballot.glsl"
#include "append/store.glsl"
#include "stages/bounce.glsl"
#include "stages/leave_light.glsl"
#include "stages/trace_persistent.glsl"

void main()
{
    trace_persistent();
}
