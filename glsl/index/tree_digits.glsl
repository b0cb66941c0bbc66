// A pass of the radix sort (least significant digit first) that orders photons by wall and, within a wall,
// by a coordinate. One thread = a run of TREE_RUN photons, so that what is equal keeps its order.

layout(set = 1, binding = 2, scalar) readonly buffer Keys { uvec2 keys[]; }; // (order key, entry of the photon map)

// Empty slots stand behind all walls.
uint digit_of(uvec2 key)
{
    if (push.digit == TREE_DIGITS) {
        return min(wall_of(photons[key.y]), FACE_COUNT);
    }
    return (key.x >> (4 * push.digit)) & (TREE_RADIX - 1);
}

uint run_count(uint length)
{
    return (length + TREE_RUN - 1) / TREE_RUN;
}
