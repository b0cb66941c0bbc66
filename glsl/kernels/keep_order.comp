// One bounce of the builder that keeps order: survivors move together.
// Dispatched by src/trace/in_order.rs once a bounce. One thread = one incoming path.
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

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "material/phong_weight.glsl"
#include "ledger/tally_copy.glsl"
#include "ledger/tally.glsl"
#include "world/room/photon.glsl"
#include "world/room/path.glsl"
#include "builder/paths.glsl"
const uint PLACES = 1;
#include "builder/group_prefix.glsl"
#include "builder/store.glsl"
#include "builder/keep_order.glsl"

void main()
{
    keep_order();
}
