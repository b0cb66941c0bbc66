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
    // The point and how far it reaches, in cells.
    vec3 place;
    float reach;
};

CellRange cells_near(vec3 position, float radius)
{
    // A little over the radius, so that rounding never costs a photon at the rim.
    float reach = radius * (1.0 + 1.0 / 1024.0);
    vec3 place = place_in_grid(position, push.cells);
    // What places of point and photon, and cells and distances made of them, may be off: at most ten times half a unit in
    // the last digit; here sixteen.
    float rounding = max(place.x, max(place.y, place.z)) * (1.0 / 1048576.0);
    return CellRange(cell_at(position - reach, push.cells), cell_at(position + reach, push.cells), place,
                     reach * push.cells.cells_per_unit + rounding);
}

// (first photon, number of photons) of the cells of row yz within reach: the disc of the radius is narrower there than across
// its middle. A row that runs over the last bucket goes on at the first: photon numbers are to be taken modulo the number
// of photons.
uvec2 row_of_photons(CellRange range, ivec2 yz)
{
    vec2 row = vec2(yz);
    vec2 off = max(max(row - range.place.yz, range.place.yz - row - 1.0), 0.0);
    float half_chord_squared = range.reach * range.reach - dot(off, off);
    if (half_chord_squared <= 0.0) {
        return uvec2(0);
    }
    // The last digits do not matter.
    float half_chord = native_root(half_chord_squared);
    int first_x = max(int(floor(range.place.x - half_chord)), range.first.x);
    int last_x = min(int(floor(range.place.x + half_chord)), range.last.x);
    uint first = bucket_of(ivec3(first_x, yz), push.cells);
    uint last = bucket_of(ivec3(last_x, yz), push.cells);
    uint end = cells[last + 1] + (last < first ? map_length() : 0);
    return uvec2(cells[first], end - cells[first]);
}
