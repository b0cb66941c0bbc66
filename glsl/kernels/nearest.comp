// Density estimation by the nearest photons of every point (gather/nearest.glsl), summed by film/SUMS.glsl.
// Dispatched by src/engine/room/estimate/tree.rs until all searches are done. One thread = one point.
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_EXT_scalar_block_layout : require

struct NearestPush {
    // Points `first_point` to `end_point` - 1.
    uint first_point;
    uint end_point;
    // How many photons are wanted.
    uint nearest;
    // 1: the searches begin.
    uint is_first;
    // Of the full radius: how far the nearest photons are looked for.
    float radius_squared;
    // log2 of the film's units in 1.
    uint film_shift;
};

layout(push_constant, scalar) uniform Push { NearestPush push; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "gather/covered_disc.glsl"
#include "film/film.glsl"
#include "film/SUMS.glsl"
#include "world/room/photon.glsl"
#include "index/tree.glsl"
#include "gather/tree_walk.glsl"
#include "gather/nearest.glsl"

void main()
{
    gather();
}
