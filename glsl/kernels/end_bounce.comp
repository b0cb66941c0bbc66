// Counts the places that the survivors of a bounce have taken: length of the photon map, paths entering the next bounce,
// and the size of its dispatch.
// Dispatched by src/engine/room/trace.rs once a bounce, as one thread.
#extension GL_EXT_scalar_block_layout : require

#include "dispatch/dispatch_size.glsl"

struct EndBouncePush {
    uint bounce;
    uint photon_capacity;
    uint items_per_group;
    uint max_groups;
};

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { EndBouncePush push; };
layout(set = 1, binding = 0, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Sizes { DispatchArgs dispatch_args[]; };


void main()
{
    uint place_count = counters[2 + push.bounce];
    uint room = push.photon_capacity - min(counters[0], push.photon_capacity);
    // Those that found no room took the last places, so that no further gap arose.
    uint path_count = min(place_count, room);
    counters[0] += place_count;
    counters[2 + push.bounce] = path_count;
    dispatch_args[0] = dispatch_size(path_count, push.items_per_group, push.max_groups);
}
