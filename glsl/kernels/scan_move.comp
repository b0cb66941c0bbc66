// The second half of a bounce by builder/scan.glsl: survivors move together.
// Dispatched by src/engine/WORLD/trace.rs once a bounce. One thread = one incoming path.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_scalar_block_layout : require

layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };

#include "dispatch/dispatch.glsl"
#include "world/WORLD/scan_move.glsl"
#include "ledger/tally_copy.glsl"

layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "ledger/tally.glsl"
#include "builder/scan_move.glsl"

void main()
{
    move_together();
}
