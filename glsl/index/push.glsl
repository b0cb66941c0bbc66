// Push constants of the kernels that sort photons.

struct IndexPush {
    vec3 origin;
    float cells_per_metre;
    uvec3 cell_count;
    uint photon_capacity;
};

struct ScanPush {
    uint item_count;
};

// A step of building the kd-tree.
struct TreePush {
    uint photon_capacity;
    // 0: along the first axis of each wall, 1: along the second.
    uint axis;
    // Digit of the radix sort, `TREE_DIGITS`: the wall.
    uint digit;
    // Of the nodes that are split: they hold `TREE_LEAF` << `height` photons.
    uint height;
};

// A hashed grid: cells of a row lie side by side.
struct CellPush {
    vec3 origin;
    float cells_per_unit;
    uint bucket_mask;
    uint photon_capacity;
    // 1: photons that it sorts count as stored; another grid of the same photons has 0.
    uint counts_stored;
};
