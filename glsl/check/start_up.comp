// The start-up check of a device.
// Dispatched by src/gpu/check.rs as one work group.
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "records.glsl"

layout(push_constant, scalar) uniform Push { CheckPush push; };
layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 4, scalar) buffer Tallies { Tally tallies[]; };

#include "film/film.glsl"
#include "film/SUMS.glsl"
#include "dispatch/dispatch.glsl"
#include "check/photons.glsl"
#include "ledger/tally_copy.glsl"
#include "ledger/tallies.glsl"
#include "builder/persistent.glsl"
#include "check/start_up.glsl"

void main()
{
    check_device();
    trace();
}
