// What the kernels that find points leave for the density estimate: visible points, and the light that
// they know already.

layout(set = 1, binding = 1, scalar) writeonly buffer VisiblePoints { VisiblePoint visible_points[]; };
// For each sample of a pixel, or receiver, film units of this pass so far, as `place_of_sums` lays them out.
layout(set = 1, binding = 2, scalar) buffer PassSums { uvec2 pass_sums[]; };

// Of layered surfaces, beside the visible point of the same number.
layout(set = 1, binding = 14, scalar) writeonly buffer RoughLobesOfPoints { RoughLobes rough_lobes[]; };
layout(set = 1, binding = 16, scalar) writeonly buffer RoughCoversOfPoints { RoughCover rough_covers[]; };

void write_rough_lobes(uint place, Lobes lobes)
{
    rough_lobes[place] = lobes.rough;
    if (HAS_IRIDESCENCE) {
        lobes.cover.film = lobes.base.film;
    }
    if (HAS_COATS || HAS_SHEEN || HAS_IRIDESCENCE) {
        rough_covers[place] = lobes.cover;
    }
}

// Of the pixel or receiver `index`. `scale` and `limit` are those of a share of the pixel's light, `rounding` is the round's. Adds to what is there, or replaces it.
void write_pass_sum(uint place, uint index, uint pixel_count, vec3 light[3], vec3 seen, float scale, float limit, uint rounding, bool adds)
{
    uint chance = mix32(rounding + place);
    // Each part is rounded by itself, so that the parts of a picture add up to the whole to the bit.
    uint kept = kept_number(index, pixel_count);
    uint first = place_of_sums(place);
    uvec2 totals[3];
    for (uint part = 0; part < 3; part++) {
        totals[part] = uvec2(0);
    }
    for (uint channel = 0; channel < 3; channel++) {
        uvec2 sum = adds ? pass_sums[first + channel] : uvec2(0);
        for (uint part = 0; part < 3; part++) {
            uvec2 units = to_film_units(light[part][channel], scale, limit, chance);
            sum = add64(sum, units);
            totals[part] = add64(totals[part], units);
            if (units != uvec2(0)) {
                add_to_parts(kept, index, pixel_count, part == 2 ? 3 : part, channel, units);
            }
        }
        pass_sums[first + channel] = sum;
        if (HAS_SEEN_LIGHT) {
            uvec2 units = to_film_units(seen[channel], scale, limit, chance);
            pass_sums[first + 3 + channel] = adds ? add64(pass_sums[first + 3 + channel], units) : units;
            totals[0] = add64(totals[0], units);
        }
    }
    add_part_total(0, totals[0]);
    add_part_total(1, totals[1]);
    add_part_total(3, totals[2]);
}

// Counts what the rays of this invocation have cost.
void note_nodes()
{
    uint count = subgroupAdd(nodes_visited);
    if (subgroupElect()) {
        add_to_anomaly(10, count);
    }
}
