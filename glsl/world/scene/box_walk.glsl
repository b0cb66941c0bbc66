// Triangles whose boxes meet a box, one node's at a time. The box may shrink from one step to the next.

// Siblings to visit: the first of them, and bits 24 to 31 for each in reach above the mask of those that are nodes at all. Of a scene
// without a hierarchy: the first triangle of the next run of its list.
uvec2 walk_group;
uvec2 walk_stack[BVH_STACK];
uint walk_depth;
// Triangles that were looked at.
uint triangles_found = 0;

void begin_walk()
{
    walk_group = uvec2(0);
    if (HAS_BVH) {
        walk_group.y = 0x01000000u;
    }
    walk_depth = 0;
}

// The next triangles: bit k of `leaves` stands for number `first_triangle` + k. False: there are no more.
bool next_leaves(vec3 low, vec3 high, out uint first_triangle, out uint leaves)
{
    if (HAS_BVH) {
        if (walk_group.y <= 0x00ffffffu) {
            if (walk_depth == 0) {
                return false;
            }
            walk_group = walk_stack[--walk_depth];
        }
        uint slot = findLSB(walk_group.y >> 24);
        walk_group.y &= ~(0x01000000u << slot);
        if (walk_group.y > 0x00ffffffu) {
            walk_stack[walk_depth++] = walk_group;
        }
        BvhNode node = nodes[walk_group.x + bitCount(walk_group.y & ((1u << slot) - 1u))];
        uint near = children_in_box(node, low, high);
        first_triangle = node.first_triangle;
        leaves = near & 0x00ffffffu;
        triangles_found += bitCount(leaves);
        walk_group = uvec2(node.first_child, (near & 0xff000000u) | child_nodes_of(node));
        return true;
    }
    first_triangle = walk_group.x;
    uint count = min(triangles.length() - first_triangle, 24u);
    leaves = (1u << count) - 1u;
    walk_group.x += count;
    triangles_found += count;
    return count != 0;
}
