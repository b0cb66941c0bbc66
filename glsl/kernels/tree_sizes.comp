// Sizes of the dispatches that build the kd-tree: a photon, a run of them, a share of a prefix sum an invocation.
// Dispatched by src/engine/room/index/tree.rs as one thread.
#extension GL_EXT_scalar_block_layout : require

#include "dispatch/dispatch_size.glsl"

layout(local_size_x = 1) in;
layout(push_constant, scalar) uniform Push { DispatchSizePush push; };
#include "index/photon_list.glsl"
layout(set = 1, binding = 2, scalar) writeonly buffer ItemArgs { DispatchArgs item_args[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer RunArgs { DispatchArgs run_args[]; };
layout(set = 1, binding = 4, scalar) writeonly buffer ScanArgs { DispatchArgs scan_args[]; };

// Folded into rows, as in dispatch_size.comp.
DispatchArgs size_of(uint item_count, uint items_per_group)
{
    uint group_count = item_count / items_per_group + (item_count % items_per_group == 0 ? 0 : 1);
    uint columns = min(group_count, push.max_groups);
    return DispatchArgs(columns, columns == 0 ? 0 : (group_count + columns - 1) / columns, 1);
}

void main()
{
    uint item_count = photon_list_length(push.capacity);
    item_args[0] = size_of(item_count, push.items_per_group);
    run_args[0] = size_of(item_count, push.items_per_group * TREE_RUN);
    scan_args[0] = size_of(item_count, push.items_per_group * SCAN_ITEMS);
}
