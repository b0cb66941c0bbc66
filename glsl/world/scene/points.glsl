// What the kernels that find points leave for the density estimate: visible points, and the light that
// they know already.

layout(set = 1, binding = 1, scalar) writeonly buffer VisiblePoints { VisiblePoint visible_points[]; };
// For each sample of a pixel, or receiver, and each channel, film units of this pass so far.
layout(set = 1, binding = 2, scalar) buffer PassSums { uvec2 pass_sums[]; };

// Of layered surfaces, beside the visible point of the same number.
layout(set = 1, binding = 14, scalar) writeonly buffer MattLobesOfPoints { MattLobes matt_lobes[]; };
layout(set = 1, binding = 16, scalar) writeonly buffer MattCoversOfPoints { MattCover matt_covers[]; };

// Points that one camera path may have.
uint points_per_path()
{
    uint count = 1;
    if (GATHER_RAYS != GATHER_NONE) {
        count = 2;
    }
    return count;
}

// Where point `k` of sample `number` stands: all pixels' first points before their second ones, so that neighbours in memory are
// neighbours in the picture.
uint place_of_point(uint k, uint pixel, uint number, uint pixel_count)
{
    return (points_per_path() * number + k) * pixel_count + pixel;
}

void write_matt_lobes(uint place, Lobes lobes)
{
    matt_lobes[place] = lobes.matt;
    bool has_cover = HAS_COATS;
    if (HAS_SHEEN) {
        has_cover = true;
    }
    if (HAS_IRIDESCENCE) {
        has_cover = true;
        lobes.cover.film = lobes.film;
    }
    if (has_cover) {
        matt_covers[place] = lobes.cover;
    }
}

// `scale` and `limit` are those of a share of the pixel's light, `rounding` is the round's. Adds to what is there, or replaces it.
void write_pass_sum(uint place, vec3 light[3], float scale, float limit, uint rounding, bool adds)
{
    uint chance = mix32(rounding + place);
    // Each part is rounded by itself, so that the parts of a picture add up to the whole to the bit.
    uvec2 totals[3];
    for (uint part = 0; part < 3; part++) {
        totals[part] = uvec2(0);
    }
    for (uint channel = 0; channel < 3; channel++) {
        uvec2 sum = adds ? pass_sums[3 * place + channel] : uvec2(0);
        for (uint part = 0; part < 3; part++) {
            uvec2 units = to_film_units(light[part][channel], scale, limit, chance);
            sum = add64(sum, units);
            totals[part] = add64(totals[part], units);
        }
        pass_sums[3 * place + channel] = sum;
    }
    add_part_total(0, totals[0]);
    add_part_total(1, totals[1]);
    add_part_total(3, totals[2]);
}
