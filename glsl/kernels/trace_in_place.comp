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

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/rng.glsl"
#include "rng/sampling.glsl"
#include "world/room/geometry.glsl"
#include "material/phong_weight.glsl"
#include "ledger/tally_copy.glsl"
#include "ledger/tally.glsl"
#include "world/room/photon.glsl"
#include "world/room/path.glsl"
#include "builder/paths.glsl"
const uint PLACES = 1;
#include "builder/group_prefix.glsl"
#include "world/room/step.glsl"
#include "builder/trace_in_place.glsl"

void main()
{
    trace_in_place();
}
