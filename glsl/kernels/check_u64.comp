// What every run relies on, asked of the device at start-up: loops that count right, a ballot that
// orders the lanes, and film sums (film/u64.glsl) that carry.
// Dispatched by src/gpu/check.rs as one work group.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { CheckPush push; };
layout(set = 1, binding = 1, scalar) buffer Answers { uint answers[]; };

#include "film/film.glsl"
#include "film/u64.glsl"

void main()
{
    // answers[0]: iterations done, of push.iteration_count; answers[1]: what they computed, which
    // the host computes too.
    uint chain = 1;
    uint iteration = 0;
    for (; iteration < push.iteration_count; iteration++) {
        chain = chain * 1664525u + 1013904223u;
    }
    if (gl_LocalInvocationIndex == 0) {
        answers[0] = iteration;
        answers[1] = chain;
    }

    // answers[2]: survivors among the odd lanes; answers[3]: sum of their exclusive counts;
    // answers[4]: subgroups.
    bool survives = (gl_SubgroupInvocationID & 1) == 1;
    uvec4 ballot = subgroupBallot(survives);
    if (survives) {
        atomicAdd(answers[2], 1);
        atomicAdd(answers[3], subgroupBallotExclusiveBitCount(ballot));
    }
    if (subgroupElect()) {
        atomicAdd(answers[4], 1);
    }

    for (uint i = 0; i < push.add_count; i++) {
        add_to_film(0, uvec2(push.addend_low, push.addend_high));
    }
}
