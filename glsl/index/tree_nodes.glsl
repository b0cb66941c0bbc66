// The node that a place of the sorted photons belongs to, while nodes of one height are split.
// wall_begins[w] = first place of wall w, wall_begins[FACE_COUNT] = stored photons.

layout(set = 1, binding = 0, scalar) readonly buffer WallBegins { uint wall_begins[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Longest { uint longest[]; }; // photons of the fullest wall

struct Node {
    uint begin;
    uint middle; // first place of its right half; at or behind the wall's end there is none
};

Node node_at(uint place)
{
    uint wall = 0;
    while (wall_begins[wall + 1] <= place) {
        wall++;
    }
    uint first = wall_begins[wall];
    uint size = TREE_LEAF << push.height;
    uint begin = first + ((place - first) & ~(size - 1));
    return Node(begin, begin + size / 2);
}

// Whether some wall has more photons than half a node: else all nodes are their own left halves.
bool splits_some_node()
{
    return longest[0] > TREE_LEAF << (push.height - 1);
}
