// Light in film units, with counts of what was clamped or was no number, and totals of each part. kernels/resolve.comp adds it up.

#include "world/scene/rounding.glsl"

// Counts: [0] values that are no number, [1] values clamped to the film's largest, [2] estimates on a mesh too dense
// for its area to be found, [3] camera paths cut off after MAX_BOUNCES; sums of two words, low word first: [4] what clamped
// values lost, in 1/1024 of the film's largest, [6] the weights of cut paths, in 2^-20,
// [8] samples of pixels that meet a surface, [10] nodes that rays of camera paths visited, [12] triangles that
// discs of estimates were cut to.
layout(set = 1, binding = 0, scalar) buffer Anomalies { uint anomalies[]; };

void add_to_anomaly(uint word, uint amount)
{
    if (atomicAdd(anomalies[word], amount) > 0xffffffffu - amount) {
        atomicAdd(anomalies[word + 1], 1);
    }
}

void note_cut_path(float weight)
{
    atomicAdd(anomalies[3], 1);
    add_to_anomaly(6, uint(min(weight * 1048576.0, 2147483648.0)));
}

// Counts a sample of a pixel whose path meets a surface that scatters light, as so many of the pixels that have most samples.
void note_surface(bool met, uint weight)
{
    if (HAS_SEEN_LIGHT) {
        uint count = subgroupAdd(met ? weight : 0u);
        if (subgroupElect() && count != 0) {
            add_to_anomaly(8, count);
        }
    }
}

// A value in film units as a 64-bit integer (low word, high word), at most `limit` units.
uvec2 to_film_units(float value, float scale, float limit, uint chance)
{
    float units = value * scale;
    if (!is_finite(units)) {
        atomicAdd(anomalies[0], 1);
        return uvec2(0);
    }
    if (units > limit) {
        atomicAdd(anomalies[1], 1);
        add_to_anomaly(4, uint(min(divide(units - limit, limit) * 1024.0 + 1.0, 2147483648.0)));
    }
    units = clamp(units, 0.0, limit);
    // Exact: a float is a 24-bit integer times a power of two.
    float whole = floor(units);
    float high = floor(whole * (1.0 / 4294967296.0));
    return add64(uvec2(uint(whole - high * 4294967296.0), uint(high)), uvec2(round_up(units - whole, chance), 0));
}

// Film units of each part of the picture over all pixels, channels and passes: two words each.
layout(set = 1, binding = 6, scalar) buffer PartTotals { uint part_totals[]; };

// Adds what the invocations of a subgroup have of a part. 16 bits at a time, as a subgroup's sum of those
// fits 32.
void add_part_total(uint part, uvec2 amount)
{
    uvec4 halves = uvec4(amount.x & 0xffffu, amount.x >> 16, amount.y & 0xffffu, amount.y >> 16);
    halves = subgroupAdd(halves);
    if (subgroupElect()) {
        uint middle = (halves.x >> 16) + halves.y;
        uint low = (halves.x & 0xffffu) | (middle << 16);
        uint high = halves.z + (middle >> 16) + (halves.w << 16);
        uint before = atomicAdd(part_totals[2 * part], low);
        high += before > 0xffffffffu - low ? 1 : 0;
        if (high != 0) {
            atomicAdd(part_totals[2 * part + 1], high);
        }
    }
}
