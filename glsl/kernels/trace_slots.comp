// One bounce, every path has a slot of its own.
// Dispatched by src/trace.rs once a bounce. One thread = one incoming path.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { TracePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Paths { uvec4 paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { uvec4 next_paths[]; };
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
#include "append/store.glsl"
#include "stages/bounce.glsl"
#include "stages/trace_slots.glsl"

void main()
{
    trace_slots();
}
