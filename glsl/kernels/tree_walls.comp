// Where the photons of each wall begin once they are sorted, and how many the fullest wall has.
// Dispatched by src/engine/room/index/tree.rs as one thread, before the last pass of a sort moves its photons.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { TreePush push; };
#include "world/room/photon.glsl"
#include "index/photon_list.glsl"
#include "index/tree_digits.glsl"
layout(set = 1, binding = 3, scalar) readonly buffer TreeCounts { uint tree_counts[]; };
layout(set = 1, binding = 4, scalar) writeonly buffer WallBegins { uint wall_begins[]; };
layout(set = 1, binding = 5, scalar) writeonly buffer Longest { uint longest[]; };

void main()
{
    uint runs = run_count(photon_list_length(push.photon_capacity));
    uint begin = 0;
    uint fullest = 0;
    wall_begins[0] = 0;
    for (uint wall = 0; wall < FACE_COUNT; wall++) {
        // The next wall's first place is this one's end; an empty list has no runs that counted.
        uint end = runs == 0 ? 0 : tree_counts[(wall + 1) * runs];
        wall_begins[wall + 1] = end;
        fullest = max(fullest, end - begin);
        begin = end;
    }
    longest[0] = fullest;
}
