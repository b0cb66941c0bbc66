// Light of each part of a path at the kept places of a film in the block under way, three channels of two words each: behind the
// totals of all pixels. Expects film/kept_places.glsl and `part_totals`.

uint place_of_part(uint kept, uint part, uint channel)
{
    return 2 * (PART_COUNT + (PART_COUNT * kept + part) * 3 + channel);
}

void add_to_kept(uint kept, uint part, uint channel, uvec2 units)
{
    uint place = place_of_part(kept, part, channel);
    uint before = atomicAdd(part_totals[place], units.x);
    uint high = units.y + (before > 0xffffffffu - units.x ? 1 : 0);
    if (high != 0) {
        atomicAdd(part_totals[place + 1], high);
    }
}
