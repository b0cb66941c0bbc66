// Photons, each from its emission to its end.
// Dispatched by src/engine/WORLD/trace.rs once a chunk. One thread = every `stride`th photon.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_scalar_block_layout : require

layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };

#include "world/WORLD/trace_persistent.glsl"
#include "ledger/tally_copy.glsl"

layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "ledger/tallies.glsl"
#include "builder/persistent.glsl"

void main()
{
    trace();
}
