// Density estimation at every point, photons found by gather/tree.glsl, summed by film/two_words.glsl.
// Dispatched by src/estimate/tree.rs once a chunk. One thread = one point and one slice of its photons.
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
#include "index/tree.glsl"
#include "gather/tree_walk.glsl"
#include "gather/estimate.glsl"
#include "gather/tree.glsl"

void main()
{
    gather();
}
