// Turns a counter on the device into the size of the next indirect dispatch, so that the host need
// not wait for it.
// Dispatched by src/engine/room/index.rs and src/engine/scene/trace.rs as one thread.
#extension GL_EXT_scalar_block_layout : require

#include "dispatch/dispatch_size.glsl"

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { DispatchSizePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sizes { DispatchArgs dispatch_args[]; };


void main()
{
    uint item_count = min(counters[push.counter], push.capacity);
    dispatch_args[0] = dispatch_size(item_count, push.items_per_group, push.max_groups);
}
