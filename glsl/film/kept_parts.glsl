// Light of each part of a path in the block under way, three channels of two words each, behind the totals of all pixels: at the kept
// places of a film; and where a picture keeps its parts, at each pixel, without direct light, which is the rest.
// Expects world/scene/effects.glsl, film/kept_places.glsl and `part_totals`.

uint place_of_part(uint kept, uint part, uint channel)
{
    return 2 * (PART_COUNT + (PART_COUNT * kept + part) * 3 + channel);
}

// Of a part other than 0.
uint place_of_pixel_part(uint pixel, uint pixel_count, uint part, uint channel)
{
    uint first = place_of_part(kept_count(pixel_count), 0, 0);
    return first + 2 * (((PART_COUNT - 1) * pixel + part - 1) * 3 + channel);
}

void add_to_part(uint place, uvec2 units)
{
    uint before = atomicAdd(part_totals[place], units.x);
    uint high = units.y + (before > 0xffffffffu - units.x ? 1 : 0);
    if (high != 0) {
        atomicAdd(part_totals[place + 1], high);
    }
}

// Of a pixel or receiver whose number among kept places is `kept`, NONE if it has none.
void add_to_parts(uint kept, uint pixel, uint pixel_count, uint part, uint channel, uvec2 units)
{
    if (kept != NONE) {
        add_to_part(place_of_part(kept, part, channel), units);
    }
    if (HAS_PARTS && part != 0) {
        add_to_part(place_of_pixel_part(pixel, pixel_count, part, channel), units);
    }
}
