// Density estimation over the kd-tree: each point tests the photons of the leaves in reach. A wall's leaves are
// shared out in slices of GATHER_SLICE photons, so that no invocation loops long.

#include "index/tree.glsl"
#include "gather/tree_walk.glsl"
#include "gather/estimate.glsl"

const uint SLICE_LEAVES = GATHER_SLICE / TREE_LEAF;

// Whether the planes above the node of a slice leave it within reach.
bool slice_in_reach(Point point, uint begin, uint first_leaf, uint leaf_count)
{
    bool in_reach = true;
    for (uint height = findLSB(SLICE_LEAVES); (1u << height) < leaf_count; height++) {
        uint node = first_leaf >> height;
        uint boundary = (node | 1u) << height;
        if (boundary < leaf_count) {
            float beyond = beyond_plane(point, begin, boundary);
            bool is_right = (node & 1u) == 1u;
            in_reach = in_reach && !((is_right ? beyond < 0.0 : beyond > 0.0) && beyond * beyond > push.radius_squared);
        }
    }
    return in_reach;
}

void gather()
{
    uint index = push.first_point + gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (index >= push.end_point) {
        return;
    }
    Point point = points[index];
    uint begin = wall_begins[point.wall];
    uint leaf_count = leaf_count_of(point.wall);
    uint first_leaf = (push.first_slice + gl_WorkGroupID.y) * SLICE_LEAVES;
    if (first_leaf >= leaf_count || !slice_in_reach(point, begin, first_leaf, leaf_count)) {
        return;
    }
    Site site = site_of(point);
    Gathered gathered = nothing_gathered();
    Walk walk = Walk(begin, first_leaf, min(first_leaf + SLICE_LEAVES, leaf_count), findLSB(SLICE_LEAVES), false, 0);
    uint leaf;
    while (next_leaf(walk, point, push.radius_squared, leaf)) {
        uint end = min(begin + (leaf + 1) * TREE_LEAF, wall_begins[point.wall + 1]);
        for (uint i = begin + leaf * TREE_LEAF; i < end; i++) {
            uvec4 photon = tree_photons[i];
            if (within_radius(site, photon)) {
                gather_photon(gathered, photon);
            }
        }
    }
    add_gathered(index, gathered);
}
