// One bounce, survivors stored by builder/block.glsl.
// Dispatched by src/trace.rs once a bounce. One thread = PATHS_TOGETHER incoming paths.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { TracePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Paths { uvec4 paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { uvec4 next_paths[]; };
layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
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
const uint PLACES = PATHS_TOGETHER;
#include "builder/paths.glsl"
#include "builder/store.glsl"
#include "builder/block.glsl"
#include "world/room/step.glsl"
#include "builder/trace_compact.glsl"

void main()
{
    trace_compact();
}
