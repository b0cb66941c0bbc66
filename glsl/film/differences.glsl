// How light would change if photons counted within a smaller radius, in the row of the block under way: a count sketch
// (src/engine/error/differences.rs), in which each pixel goes to one sum of its channel, with a sign of its own.

// Two words a sum, in two's complement; the row under way is the last one.
layout(set = 1, binding = 20, scalar) buffer Differences { uint differences[]; };

// A number, that is at most `limit` either way, without its fraction.
uvec2 signed64(float value, float limit)
{
    float whole = min(floor(abs(value)), limit);
    float high = floor(whole * (1.0 / 4294967296.0));
    uvec2 size = uvec2(uint(whole - high * 4294967296.0), uint(high));
    return value < 0.0 ? add64(~size, uvec2(1, 0)) : size;
}

// Adds a difference of a pixel, in film units.
void add_difference(uint pixel, uint pixel_count, vec3 units, float limit)
{
    uint sum_count = min(pixel_count, DIFFERENCE_SUMS);
    uint row = DIFFERENCE_ROWS * (3 * sum_count + 1);
    uint hash = mix32(pixel);
    float sign = (hash >> 31) != 0 ? -1.0 : 1.0;
    // Where there is room, each pixel has a sum of its own.
    uint sum = pixel_count == sum_count ? pixel : hash % sum_count;
    for (uint channel = 0; channel < 3; channel++) {
        if (!is_finite(units[channel])) {
            // The light itself is no number either, and is counted where it joins the film.
            continue;
        }
        uvec2 amount = signed64(sign * units[channel], limit);
        uint place = 2 * (row + 3 * sum + channel);
        uint before = atomicAdd(differences[place], amount.x);
        uint high = amount.y + (before > 0xffffffffu - amount.x ? 1 : 0);
        if (high != 0) {
            atomicAdd(differences[place + 1], high);
        }
    }
}
