// Density estimation by the nearest photons of every point (gather/nearest.glsl), summed by film/SUMS.glsl.
// Dispatched by src/engine/room/estimate/tree.rs until all searches are done. One thread = one point.
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "records.glsl"

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
