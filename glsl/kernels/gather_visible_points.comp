// Density estimation of a photon map, sums added by film/SUMS.glsl.
// Dispatched by src/engine/scene/estimate.rs twice a chunk and grid. One thread = one slice of a point's
// candidates: points along x, slices along y.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"
#include "world/scene/work.glsl"

struct SceneGatherPush {
    WorkDivision work;
    uint first_point;
    uint end_point;
    uint point_count;
    uint pixel_count;
    // Index of the arrival that the map holds, where it holds one only: where its sums stand.
    uint arrival;
    uint round;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    // Of the picture; 0 where points are receivers, in an order of their own.
    uint width;
    uint height;
    // 0: the first slice of candidates of every point; 1: all others of those that have more.
    uint first_slice;
    // Invocations that share a point.
    uint lanes;
    // Of class 0.
    float radius;
    // `GLOBAL_CLASS` or `CAUSTIC_CLASS`, and the classes that this grid serves: `first_class` to `end_class` - 1.
    uint map_class;
    uint first_class;
    uint end_class;
    // Where the map's cuts begin.
    uint first_cut;
    CellPush cells;
};

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { SceneGatherPush push; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "film/wide.glsl"
#include "film/SUMS.glsl"
#include "math/directions.glsl"
#include "world/scene/effects.glsl"
#include "world/scene/sample_places.glsl"
#include "material/lobes/phong.glsl"
#include "material/rough_brdf.glsl"
#include "gather/belongs.glsl"
#include "index/buckets.glsl"
#include "world/scene/rounding.glsl"
#include "world/scene/tiles.glsl"
#include "gather/bucket_rows.glsl"
#include "gather/radius_class.glsl"
#include "gather/disc_cuts.glsl"
#include "gather/near.glsl"
#include "gather/visible_points.glsl"

void main()
{
    gather_photons();
}
