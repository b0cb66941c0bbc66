// The kd-tree over the photons: one tree a wall, as a point sees the photons of its own wall only, split
// along the wall's two axes in turn. Twin of src/cpu/tree.rs.
//
// A wall's photons stand side by side, so that the tree is a matter of places: leaf j of a wall holds its
// photons TREE_LEAF * j to TREE_LEAF * (j + 1) - 1, the node of height h that begins at leaf j (a multiple
// of 2^h) the 2^h leaves from there on, and the last node of a height as many as there are. So every
// boundary b between leaves splits one node, that of height 1 + (trailing zeros of b): photons before it
// have a coordinate up to its plane's, those behind it the plane's or more. The tree is balanced to the left
// and as deep as log2 of the leaves, however the photons lie.
//
// Planes prune without a margin: differences, squares and sums that are each rounded to nearest grow with
// their operands, so a photon behind a plane is never computed to be nearer than the plane itself.

// Axis that nodes of a height are split along: one of the wall's two.
uint tree_axis(uint wall, uint height)
{
    return (wall / 2 + 1 + (height & 1)) % 3;
}

// Place of the plane of boundary b of a wall whose photons begin at `begin`. Walls do not share places, as
// two boundaries are more than TREE_LEAF photons apart.
uint plane_place(uint begin, uint boundary)
{
    return (begin + boundary * TREE_LEAF) / TREE_LEAF;
}

// A number that grows with a coordinate, bit by bit, and back.
uint order_key(float coordinate)
{
    uint bits = floatBitsToUint(coordinate);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}

float key_coordinate(uint key)
{
    return uintBitsToFloat((key & 0x80000000u) != 0 ? key ^ 0x80000000u : ~key);
}
