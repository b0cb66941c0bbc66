// Splits the nodes of one height along one axis: notes the place of every photon in the order along it, and
// the planes.
// Dispatched by src/engine/room/index/tree.rs once a height. One thread = one photon of a node.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { TreePush push; };
#include "index/tree_nodes.glsl"
layout(set = 1, binding = 2, scalar) readonly buffer Keys { uvec2 keys[]; }; // in order along the axis
layout(set = 1, binding = 3, scalar) writeonly buffer TreeRanks { uint tree_ranks[]; };
layout(set = 1, binding = 4, scalar) writeonly buffer Planes { float planes[]; };

#include "dispatch/dispatch.glsl"
#include "index/tree.glsl"

void main()
{
    uint place = invocation_index();
    if (place >= wall_begins[FACE_COUNT] || !splits_some_node()) {
        return;
    }
    uvec2 key = keys[place];
    tree_ranks[key.y] = place;
    if (place == node_at(place).middle) {
        planes[place / TREE_LEAF] = key_coordinate(key.x);
    }
}
