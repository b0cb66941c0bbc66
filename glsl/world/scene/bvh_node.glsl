// A node of the hierarchy: the boxes of its eight children, whose corners are whole numbers below 256 of a power of two along
// each axis, from the node's own corner on. Twin of src/scene/bvh.rs.

// Node of a compressed wide BVH (Ylitie, Karras and Laine 2017): eight children in boxes of 8-bit
// planes.
struct BvhNode {
    vec3 origin;
    // Exponents of the planes' spacing along x, y, z, and the mask of children that are nodes, a
    // byte each.
    uint spacing;
    uint first_child;
    uint first_triangle;
    // A byte a child: where it is, or how many triangles it holds.
    uvec2 meta;
    uvec2 min_x;
    uvec2 max_x;
    uvec2 min_y;
    uvec2 max_y;
    uvec2 min_z;
    uvec2 max_z;
};

uint byte_of(uvec2 bytes, uint index)
{
    return ((index < 4 ? bytes.x : bytes.y) >> (8 * (index & 3u))) & 0xffu;
}

vec3 spacing_of(BvhNode node)
{
    return uintBitsToFloat((uvec3(node.spacing, node.spacing >> 8, node.spacing >> 16) & 0xffu) << 23);
}

// Which children are nodes, a bit each.
uint child_nodes_of(BvhNode node)
{
    return node.spacing >> 24;
}

vec3 low_corner(BvhNode node, uint child)
{
    return vec3(byte_of(node.min_x, child), byte_of(node.min_y, child), byte_of(node.min_z, child)) * spacing_of(node) + node.origin;
}

vec3 high_corner(BvhNode node, uint child)
{
    return vec3(byte_of(node.max_x, child), byte_of(node.max_y, child), byte_of(node.max_z, child)) * spacing_of(node) + node.origin;
}
