// The runs of photons that a point's query touches, one a row of cells.
// cells[b] = first photon of bucket b; behind the last bucket stands the number of all photons.

layout(set = 1, binding = 1, scalar) readonly buffer Cells { uint cells[]; };

uint map_length()
{
    return cells[push.cells.bucket_mask + 1];
}

struct CellRange {
    ivec3 first;
    ivec3 last;
};

CellRange cells_near(vec3 position)
{
    // A little over the radius, so that rounding never costs a photon at the rim.
    float reach = push.radius * (1.0 + 1.0 / 1024.0);
    return CellRange(cell_at(position - reach, push.cells), cell_at(position + reach, push.cells));
}

// (first photon, number of photons) of row yz. A row that runs over the last bucket goes on at the first:
// photon numbers are to be taken modulo the number of photons.
uvec2 row_of_photons(CellRange range, ivec2 yz)
{
    uint first = bucket_of(ivec3(range.first.x, yz), push.cells);
    uint last = bucket_of(ivec3(range.last.x, yz), push.cells);
    uint end = cells[last + 1] + (last < first ? map_length() : 0);
    return uvec2(cells[first], end - cells[first]);
}
