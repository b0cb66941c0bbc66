// Density estimation of a photon map, sums added by film/two_words.glsl.
// Dispatched by src/transport/points.rs twice a map and chunk. One thread = one slice of a point's
// candidates: points along x, slices along y.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { SceneGatherPush push; };

#include "math.glsl"
#include "nonfinite_values.glsl"
#include "film/wide.glsl"
#include "film/two_words.glsl"
#include "scene/directions.glsl"
#include "scene/effects.glsl"
#include "scene/lobes.glsl"
#include "scene/belongs.glsl"
#include "scene/cells.glsl"
#include "scene/rounding.glsl"
#include "scene/tiles.glsl"
#include "stages/map_rows.glsl"
#include "stages/scene_gather.glsl"

void main()
{
    gather_photons();
}
