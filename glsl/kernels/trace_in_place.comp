// One bounce of the builder that keeps order: survivors are marked and counted.
// Dispatched by src/trace/in_order.rs once a bounce. One thread = one incoming path.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { TracePush push; };
layout(set = 1, binding = 0, scalar) buffer Paths { uvec4 paths[]; };
#define next_paths paths // each stays where it is
layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "math.glsl"
#include "nonfinite_values.glsl"
#include "dispatch.glsl"
#include "rng.glsl"
#include "sampling.glsl"
#include "room.glsl"
#include "bsdf.glsl"
#include "tally_copy.glsl"
#include "tally.glsl"
#include "photon.glsl"
#include "path.glsl"
#include "append/paths.glsl"
const uint PLACES = 1;
#include "append/group_prefix.glsl"
#include "stages/bounce.glsl"
#include "stages/trace_in_place.glsl"

void main()
{
    trace_in_place();
}
