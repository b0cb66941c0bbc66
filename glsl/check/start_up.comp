// The start-up check of a device.
// Dispatched by src/gpu/check.rs as one work group.
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_EXT_scalar_block_layout : require

struct CheckPush {
    uint iteration_count;
    uint addend_low;
    uint addend_high;
    uint add_count;
    // Photons of a loop in which lanes vote, and invocations that take them.
    uint photon_count;
    uint stride;
};

layout(push_constant, scalar) uniform Push { CheckPush push; };
layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };

#include "film/film.glsl"
#include "film/SUMS.glsl"
#include "dispatch/dispatch.glsl"
#include "check/photons.glsl"
#include "ledger/tally_copy.glsl"

layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "ledger/tallies.glsl"
#include "builder/persistent.glsl"
#include "check/start_up.glsl"

void main()
{
    check_device();
    trace();
}
