// The hashed grid of a photon map: rows of cells along x are spread over the buckets by a hash of (y, z),
// and the cells of a row lie side by side, so that a query reads one run of photons a row. Different rows
// may share buckets: a query asks each photon for its row.

// In cells. Monotone in `position`, for any rounding (see index/grid.glsl); queries stay on the positive side, as the
// origin lies a reach outside of the scene.
vec3 place_in_grid(vec3 position, CellPush grid)
{
    precise vec3 place = (position - grid.origin) * grid.cells_per_unit;
    return place;
}

ivec3 cell_at(vec3 position, CellPush grid)
{
    return ivec3(floor(place_in_grid(position, grid)));
}

uint row_hash(ivec2 yz)
{
    uint hash = uint(yz.x) * 0x9e3779b1u ^ uint(yz.y) * 0x85ebca77u;
    hash ^= hash >> 15;
    hash *= 0x2c1b3c6du;
    return hash ^ (hash >> 13);
}

uint bucket_of(ivec3 cell, CellPush grid)
{
    return (row_hash(cell.yz) + uint(cell.x)) & grid.bucket_mask;
}
