// A walk over the leaves of a wall's kd-tree (glsl/index/tree.glsl) that may hold a photon within a distance, from
// left to right. The places say what comes next, so it needs no stack.

#include "gather/points.glsl"

layout(set = 1, binding = 1, scalar) readonly buffer WallBegins { uint wall_begins[]; };
layout(set = 1, binding = 2, scalar) readonly buffer Planes { float planes[]; };
layout(set = 1, binding = 3, scalar) readonly buffer TreePhotons { uvec4 tree_photons[]; };

struct Walk {
    uint begin;     // the wall's first photon
    uint leaf;      // leaves before it are done
    uint end;       // one past the last leaf
    uint height;    // of the node that begins at `leaf`
    bool from_left; // all before the node is done, and whether its half is in reach not yet known
    uint steps;
};

uint leaf_count_of(uint wall)
{
    return (wall_begins[wall + 1] - wall_begins[wall] + TREE_LEAF - 1) / TREE_LEAF;
}

// How far a point lies behind the plane of a boundary; below 0 in front of it.
float beyond_plane(Point point, uint begin, uint boundary)
{
    uint axis = tree_axis(point.wall, findLSB(boundary) + 1);
    return point.position[axis] - planes[plane_place(begin, boundary)];
}

// Whether some leaf is left, and which.
bool next_leaf(inout Walk walk, Point point, float limit, out uint leaf)
{
    while (walk.leaf < walk.end) {
        walk.steps++;
        if (walk.from_left) {
            walk.height = findLSB(walk.leaf);
            float beyond = beyond_plane(point, walk.begin, walk.leaf);
            if (beyond < 0.0 && beyond * beyond > limit) {
                walk.leaf += 1u << walk.height;
                continue;
            }
            walk.from_left = false;
        }
        if (walk.height == 0) {
            leaf = walk.leaf;
            walk.leaf++;
            walk.from_left = true;
            return true;
        }
        walk.height--;
        uint boundary = walk.leaf + (1u << walk.height);
        if (boundary < walk.end) {
            float beyond = beyond_plane(point, walk.begin, boundary);
            if (beyond > 0.0 && beyond * beyond > limit) {
                walk.leaf = boundary;
            }
        }
    }
    return false;
}
