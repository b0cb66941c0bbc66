// Moves photons to the half of their node that they belong to and keeps their order along the other axis, so
// that no node is ever sorted again.
// Dispatched by src/engine/room/index/tree.rs once a height. One thread = one photon of a node.
// tree_counts[i] = photons before i that go left.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { TreePush push; };
#include "index/tree_nodes.glsl"
layout(set = 1, binding = 2, scalar) readonly buffer Keys { uvec2 keys[]; };
layout(set = 1, binding = 3, scalar) readonly buffer TreeRanks { uint tree_ranks[]; };
layout(set = 1, binding = 4, scalar) readonly buffer TreeCounts { uint tree_counts[]; };
layout(set = 1, binding = 5, scalar) writeonly buffer NextKeys { uvec2 next_keys[]; };

#include "dispatch/dispatch.glsl"

void main()
{
    uint place = invocation_index();
    if (place >= wall_begins[FACE_COUNT]) {
        return;
    }
    uvec2 key = keys[place];
    uint next_place = place;
    if (splits_some_node()) {
        Node node = node_at(place);
        uint lefts = tree_counts[place] - tree_counts[node.begin];
        next_place = tree_ranks[key.y] < node.middle ? node.begin + lefts : node.middle + (place - node.begin) - lefts;
    }
    next_keys[next_place] = key;
}
