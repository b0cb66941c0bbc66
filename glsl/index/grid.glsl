// The uniform grid that sorts photons: cells numbered along x first, so that the cells of one row
// that a query touches hold one run of the sorted photons.

// Monotone in `position`, for any rounding: a photon between two positions lies in a cell between
// theirs. That is why a query that walks from cell_of(p - reach) to cell_of(p + reach) misses none.
uvec3 cell_of(vec3 position, vec3 origin, float cells_per_metre, uvec3 cell_count)
{
    precise vec3 cell = floor((position - origin) * cells_per_metre);
    return uvec3(clamp(cell, vec3(0.0), vec3(cell_count - 1u)));
}

uint cell_number(uvec3 cell, uvec3 cell_count)
{
    return (cell.z * cell_count.y + cell.y) * cell_count.x + cell.x;
}
