// The rows of grid cells that a point's query touches; each is one run of the sorted photons.
// cells[c] = first photon of cell c; behind the last cell stands the number of all photons.

layout(set = 1, binding = 1, scalar) readonly buffer Cells { uint cells[]; };

struct CellBox {
    uvec3 first;
    uvec3 last;
};

CellBox cells_in_reach(vec3 position)
{
    return CellBox(cell_of(position - push.reach, push.origin, push.cells_per_metre, push.cell_count),
                   cell_of(position + push.reach, push.origin, push.cells_per_metre, push.cell_count));
}

// [begin, end) of row (y, z) of the box.
uvec2 row_run(CellBox box, uint y, uint z)
{
    uint first = cell_number(uvec3(box.first.x, y, z), push.cell_count);
    uint last = cell_number(uvec3(box.last.x, y, z), push.cell_count);
    return uvec2(cells[first], cells[last + 1]);
}
