// Density estimation at every point of the paper's box, by each index and each kind of the film's sums.
// Dispatched by src/engine/room/estimate.rs once a chunk. One thread = one point and one slice of its photons; of a grid LANES
// threads = one point.
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_EXT_scalar_block_layout : require

#include "gather/points.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { GatherPush push; };

#include "film/film.glsl"
#include "film/SUMS.glsl"
#include "film/float_SUMS.glsl"
#include "world/room/photon.glsl"
#include "gather/INDEX.glsl"

void main()
{
    gather();
}
