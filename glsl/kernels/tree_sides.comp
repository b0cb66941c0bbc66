// Says which photons go to the left half of their node, in the order along the other axis.
// Dispatched by src/engine/room/index/tree.rs once a height. One thread = one photon of a node.
// After it tree_counts[i] = 1 where photon i goes left.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { TreePush push; };
#include "index/tree_nodes.glsl"
layout(set = 1, binding = 2, scalar) readonly buffer Keys { uvec2 keys[]; }; // in order along the other axis
layout(set = 1, binding = 3, scalar) readonly buffer TreeRanks { uint tree_ranks[]; };
layout(set = 1, binding = 4, scalar) writeonly buffer TreeCounts { uint tree_counts[]; };

#include "dispatch/dispatch.glsl"

void main()
{
    uint place = invocation_index();
    if (place >= wall_begins[FACE_COUNT] || !splits_some_node()) {
        return;
    }
    tree_counts[place] = tree_ranks[keys[place].y] < node_at(place).middle ? 1 : 0;
}
