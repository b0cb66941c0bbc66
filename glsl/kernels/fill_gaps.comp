// Ends a bounce whose survivors took places from striped counters (builder/striped_counters.glsl): says how many places that
// makes, gaps included, marks the gaps as no photon and no path, and empties the counters for the next bounce.
// Dispatched by src/engine/room/trace.rs once a bounce, as one work group. One thread = every so many-th gap.
#extension GL_EXT_scalar_block_layout : require

struct FillGapsPush {
    uint bounce;
    uint bounces;
    uint path_capacity;
    uint photon_capacity;
};

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { FillGapsPush push; };
layout(set = 1, binding = 0, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Photons { uvec4 photons[]; };
layout(set = 1, binding = 2, scalar) writeonly buffer NextPaths { uvec4 next_paths[]; };

#include "world/room/photon.glsl"
#include "world/room/photon_state.glsl"

uint lists_end()
{
    return push.bounces + 2;
}

#include "builder/striped_counters.glsl"

void main()
{
    uint end = 0;
    for (uint turn = 0; turn < COUNTERS; turn++) {
        uint taken = counters[striped_counter(turn)];
        end = max(end, taken == 0 ? 0 : striped_place(turn, taken - 1) + 1);
    }
    uint first_photon = counters[0];
    for (uint turn = 0; turn < COUNTERS; turn++) {
        uint gap = counters[striped_counter(turn)] + gl_LocalInvocationIndex;
        for (uint place = striped_place(turn, gap); place < end; gap += gl_WorkGroupSize.x, place = striped_place(turn, gap)) {
            if (first_photon + place < push.photon_capacity) {
                photons[first_photon + place] = pack_photon(Photon(vec3(0.0), NO_WALL, 0.0, 0.0, 0, 0));
            }
            next_paths[path_word(0, place, push.path_capacity)].w = NO_WALL;
        }
    }
    memoryBarrierBuffer();
    barrier(); // all have read the counters
    for (uint turn = gl_LocalInvocationIndex; turn < COUNTERS; turn += gl_WorkGroupSize.x) {
        counters[striped_counter(turn)] = 0;
    }
    if (gl_LocalInvocationIndex == 0) {
        counters[2 + push.bounce] = end;
    }
}
