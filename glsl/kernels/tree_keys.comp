// What the kd-tree sorts its photons by along one axis of their walls.
// Dispatched by src/engine/room/index/tree.rs once an axis. One thread = one entry of the photon map.
#extension GL_EXT_scalar_block_layout : require

#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { TreePush push; };
#include "index/photon_list.glsl"
layout(set = 1, binding = 2, scalar) writeonly buffer Keys { uvec2 keys[]; };

#include "dispatch/dispatch.glsl"
#include "world/room/photon.glsl"
#include "index/tree.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= photon_list_length(push.photon_capacity)) {
        return;
    }
    keys[index] = uvec2(order_key(place_of(photons[index])[push.axis]), index);
}
