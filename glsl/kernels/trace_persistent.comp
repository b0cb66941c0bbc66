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

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/rng.glsl"
#include "rng/sampling.glsl"
#include "world/room/geometry.glsl"
#include "material/phong_weight.glsl"
#include "world/room/emission.glsl"
#include "ledger/tally_copy.glsl"
#include "ledger/tallies.glsl"
#include "world/room/photon.glsl"
#include "world/room/path.glsl"
#include "builder/ballot.glsl"
#include "builder/store.glsl"
#include "world/room/step.glsl"
#include "world/room/emit.glsl"
#include "builder/trace_persistent.glsl"

void main()
{
    trace_persistent();
}
