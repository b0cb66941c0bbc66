// Counts the survivors that keep_order.comp has moved: length of the photon map, and paths entering the next bounce.
// Dispatched by src/trace/in_order.rs once a bounce, as one thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { EndBouncePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Survivors { uint survivors[]; };
layout(set = 1, binding = 1, scalar) buffer Counters { uint counters[]; };

void main()
{
    uint survivor_count = survivors[push.total];
    uint room = push.photon_capacity - min(counters[0], push.photon_capacity);
    counters[0] += survivor_count;
    counters[2 + push.bounce] = min(survivor_count, room);
}
