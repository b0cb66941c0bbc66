// Skies: one radiance for all directions, or a picture of them and a table that samples it (src/scene/sky_table.rs). A light sample leaves by the
// cosine or by the table, and weighs by the density of both together (the balance heuristic, Veach 1997, section 9.2).

// A direction, and its density, 1/sr.
struct SkySample {
    vec3 wi;
    float density;
};

// By a unit quaternion (x, y, z; w), or back by its inverse (-x, -y, -z; w).
vec3 turned(vec3 v, vec3 axis, float w)
{
    return v + 2.0 * cross(axis, cross(axis, v) + w * v);
}

// Place in the picture of a direction, both coordinates from 0 to 1.
vec2 place_in_sky(Emitter sky, vec3 wi)
{
    vec3 local = turned(wi, -sky.position, sky.size);
    float turns = atan(local.z, local.x) * 0.15915494309189535;
    float angle = atan(sqrt(local.x * local.x + local.z * local.z), local.y) * 0.31830988618379067;
    return vec2(0.5 + turns, angle);
}

// Radiance from a direction.
vec3 sky_radiance(Emitter sky, vec3 wi)
{
    if (HAS_SKY_PICTURE) {
        return sky.strength * sample_texture(textures[sky.triangle], place_in_sky(sky, wi)).xyz;
    }
    return sky.strength;
}

float share_word(uint place)
{
    return uintBitsToFloat(texel_word(place));
}

// Solid angle of each cell of a row of the table, which ends at two angles to the vertical.
float solid_angle_of_cells(TextureInfo table, uint row)
{
    uint edges = table.first_texel + table.height;
    return divide(6.28318530717958648 * abs(share_word(edges + row + 1) - share_word(edges + row)), float(table.width));
}

// Share that ends at a word of cumulative shares, which begin at `first`.
float share_at(uint first, uint number)
{
    return share_word(first + number) - (number == 0 ? 0.0 : share_word(first + number - 1));
}

// Where the shares of a row's cells begin.
uint first_cell_of(TextureInfo table, uint row)
{
    return table.first_texel + 2 * table.height + 1 + row * table.width;
}

// Column and row of a place in the picture.
uvec2 cell_at_place(TextureInfo table, vec2 place)
{
    return min(uvec2(max(place * vec2(table.width, table.height), vec2(0.0))), uvec2(table.width, table.height) - 1);
}

// Density with which the table chooses a direction, 1/sr.
float sky_table_density(Emitter sky, vec3 wi)
{
    TextureInfo table = textures[sky.triangle + 1];
    uvec2 cell = cell_at_place(table, place_in_sky(sky, wi));
    float share = share_at(table.first_texel, cell.y) * share_at(first_cell_of(table, cell.y), cell.x);
    return divide(share, solid_angle_of_cells(table, cell.y));
}

// The first of `count` cumulative shares above u, which becomes uniform within that share.
uint pick_share(uint first, uint count, inout float u)
{
    uint low = 0, high = count - 1;
    while (low < high) {
        uint middle = (low + high) / 2;
        if (share_word(first + middle) > u) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    float share = share_at(first, low);
    u = clamp(divide(u - (share_word(first + low) - share), share), 0.0, 0.99999994);
    return low;
}

// A direction in a cell of the table, even over its solid angle.
vec3 direction_in_cell(Emitter sky, TextureInfo table, uint column, uint row, vec2 u)
{
    uint edges = table.first_texel + table.height;
    float first = share_word(edges + row);
    float versine = first + u.y * (share_word(edges + row + 1) - first);
    float height = row < table.height / 2 ? 1.0 - versine : versine - 1.0;
    float turns = divide(float(column) + u.x, float(table.width));
    vec3 local = direction_at(height, versine * (2.0 - versine), turns < 0.5 ? turns + 0.5 : turns - 0.5).xzy;
    return turned(local, sky.position, sky.size);
}

// Its density is that of the cell that was chosen: next to one far brighter, rounding may place a direction in the other.
SkySample sample_sky_table(Emitter sky, vec2 u)
{
    TextureInfo table = textures[sky.triangle + 1];
    uint row = pick_share(table.first_texel, table.height, u.y);
    uint cells = first_cell_of(table, row);
    uint column = pick_share(cells, table.width, u.x);
    float share = share_at(table.first_texel, row) * share_at(cells, column);
    return SkySample(direction_in_cell(sky, table, column, row, u), divide(share, solid_angle_of_cells(table, row)));
}

float cosine_density(vec3 ns, vec3 wi)
{
    return max(dot(wi, ns), 0.0) * 0.31830988618379067;
}

// Density of light samples of which the table chooses a share, and the others have this density.
float density_with_table(Emitter sky, float by_table, vec3 wi, float others)
{
    if (HAS_SKY_PICTURE) {
        others = (1.0 - by_table) * others + by_table * sky_table_density(sky, wi);
    }
    return others;
}

// A light sample where there are no openings to aim at.
SkySample sample_open_sky(Emitter sky, vec3 ns, vec2 u)
{
    if (HAS_SKY_PICTURE) {
        float by_table = sky.outer_versine;
        if (u.x < by_table) {
            SkySample found = sample_sky_table(sky, vec2(divide(u.x, by_table), u.y));
            found.density = (1.0 - by_table) * cosine_density(ns, found.wi) + by_table * found.density;
            return found;
        }
        u.x = divide(u.x - by_table, 1.0 - by_table);
    }
    vec3 wi = to_frame(sample_cosine_hemisphere(u.x, u.y), ns);
    return SkySample(wi, density_with_table(sky, sky.outer_versine, wi, cosine_density(ns, wi)));
}
