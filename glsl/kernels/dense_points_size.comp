// Size of the second part of a lookup: points with more candidates than one slice along x, their other slices along y.
// Dispatched by src/engine/scene/estimate.rs as one thread.
#extension GL_EXT_scalar_block_layout : require

#include "dispatch/dispatch_size.glsl"

struct DensePointsSizePush {
    uint items_per_group;
    uint max_groups;
};

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { DensePointsSizePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer DensePoints { uint dense_points[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sizes { DispatchArgs dispatch_args[]; };

void main()
{
    uint slice_count = (dense_points[1] + GATHER_SLICE - 1) / GATHER_SLICE;
    uint point_groups = (dense_points[0] + push.items_per_group - 1) / push.items_per_group;
    dispatch_args[0] = DispatchArgs(point_groups, point_groups == 0 ? 0 : min(slice_count - 1, push.max_groups), 1);
}
