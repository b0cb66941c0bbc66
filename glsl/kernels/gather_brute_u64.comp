// Density estimation at every point, photons found by gather/brute.glsl, summed by film/u64.glsl
// and film/compensated.glsl.
// Dispatched by src/estimate.rs once a chunk. One thread = one point and one slice of its photons.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { GatherPush push; };

#include "film/film.glsl"
#include "film/u64.glsl"
#include "film/compensated.glsl"
#include "world/room/photon.glsl"
#include "gather/estimate.glsl"
#include "gather/brute.glsl"

void main()
{
    gather();
}
