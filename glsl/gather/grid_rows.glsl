// The rows of grid cells that a point's query touches; each is one run of the sorted photons.
// cells[c] = first photon of cell c; behind the last cell stands the number of all photons.

layout(set = 1, binding = 1, scalar) readonly buffer Cells { uint cells[]; };

struct CellBox {
    uvec3 first;
    uvec3 last;
};

// Photons of the point's wall share its coordinate across the wall to the bit, and so its cell.
CellBox cells_in_reach(Point point)
{
    CellBox box = CellBox(cell_of(point.position - push.reach, push.origin, push.cells_per_metre, push.cell_count),
                          cell_of(point.position + push.reach, push.origin, push.cells_per_metre, push.cell_count));
    uint axis = point.wall / 2;
    uint layer = cell_of(point.position, push.origin, push.cells_per_metre, push.cell_count)[axis];
    box.first[axis] = layer;
    box.last[axis] = layer;
    return box;
}

// [begin, end) of row (y, z) of the box.
uvec2 row_run(CellBox box, uint y, uint z)
{
    uint first = cell_number(uvec3(box.first.x, y, z), push.cell_count);
    uint last = cell_number(uvec3(box.last.x, y, z), push.cell_count);
    return uvec2(cells[first], cells[last + 1]);
}
