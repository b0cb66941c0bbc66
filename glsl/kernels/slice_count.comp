// Size of a gather in slices: invocations for the points along x, slices of their candidates along y.
// Dispatched by src/engine/room/estimate.rs as one thread.
#extension GL_EXT_scalar_block_layout : require

#include "dispatch/dispatch_size.glsl"

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { DispatchSizePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Longest { uint longest[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sizes { DispatchArgs dispatch_args[]; };

void main()
{
    uint slice_count = (longest[0] + GATHER_SLICE - 1) / GATHER_SLICE;
    uint point_groups = (push.capacity + push.items_per_group - 1) / push.items_per_group;
    dispatch_args[0] = DispatchArgs(point_groups, min(slice_count, push.max_groups), 1);
}
