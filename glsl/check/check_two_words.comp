// The start-up check of a device, film sums by film/two_words.glsl.
// Dispatched by src/gpu/check.rs as one work group.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { CheckPush push; };

#include "film/film.glsl"
#include "film/two_words.glsl"

#include "check/start_up.glsl"

void main()
{
    check_device();
}
