// Work groups for items that only the device has counted, folded into rows as dispatch/dispatch.glsl unfolds them.

// `VkDispatchIndirectCommand`.
struct DispatchArgs {
    uint x;
    uint y;
    uint z;
};

struct DispatchSizePush {
    uint counter;
    uint capacity;
    uint items_per_group;
    uint max_groups;
};

DispatchArgs dispatch_size(uint item_count, uint items_per_group, uint max_groups)
{
    uint group_count = item_count / items_per_group + (item_count % items_per_group == 0 ? 0 : 1);
    uint columns = min(group_count, max_groups);
    uint rows = columns == 0 ? 0 : (group_count + columns - 1) / columns;
    return DispatchArgs(columns, rows, 1);
}
