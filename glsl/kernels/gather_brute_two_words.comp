// Density estimation at every point, photons found by gather/brute.glsl, summed by film/two_words.glsl
// and film/f32.glsl.
// Dispatched by src/estimate.rs once a chunk. One thread = one point and one slice of its photons.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { GatherPush push; };

#include "film/film.glsl"
#include "film/two_words.glsl"
#include "film/f32.glsl"
#include "world/room/photon.glsl"
#include "gather/estimate.glsl"
#include "gather/brute.glsl"

void main()
{
    gather();
}
