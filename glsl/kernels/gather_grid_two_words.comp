// Density estimation at every point, photons found by gather/grid.glsl, summed by film/two_words.glsl
// and film/f32.glsl.
// Dispatched by src/estimate.rs once a chunk. LANES threads = one point, or one slice of its photons.
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
#include "index/grid.glsl"
#include "gather/grid_rows.glsl"
#include "gather/estimate.glsl"
#include "gather/grid.glsl"

void main()
{
    gather();
}
