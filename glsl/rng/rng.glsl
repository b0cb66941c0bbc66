// Random numbers of a photon, a function of (seed, round, photon, draw) alone. Twin of src/rng.rs.
//
// `stream` is what a path carries between bounces: the 48-bit state of rand48, the two state words
// of MT19937 that the next output needs, nothing for Philox, (sample, key of its light) of Sobol' points.

#include "rng/hash.glsl"
#include "rng/philox.glsl"
#include "rng/sobol.glsl"

layout(constant_id = 1) const uint RNG = RNG_PHILOX;

// x * multiplier + increment mod 2^48; .x holds the low 32 bits, .y the high 16.
uvec2 affine48(uvec2 x, uvec2 multiplier, uvec2 increment)
{
    uint high, low, carry;
    umulExtended(x.x, multiplier.x, high, low);
    high += x.x * multiplier.y + x.y * multiplier.x;
    low = uaddCarry(low, increment.x, carry);
    return uvec2(low, (high + increment.y + carry) & 0xffffu);
}

float rand48_next(inout uvec2 state, RandomKey key)
{
    float u = unit_float((state.y << 8) | (state.x >> 24));
    state = affine48(state, key.leap_multiplier, key.leap_increment);
    return u;
}

// Seeding recurrence of MT19937 (Matsumoto and Nishimura, 2002): word `index` from the one before.
uint mt_word(uint previous, uint index)
{
    return 1812433253u * (previous ^ (previous >> 30)) + index;
}

uvec2 mt_open(uint seed)
{
    uint word = seed;
    for (uint i = 1; i <= MT_MIDDLE; i++) {
        word = mt_word(word, i);
    }
    return uvec2(seed, word);
}

// Output `draw` of the twister; draw + MT_MIDDLE must stay below 624, the words that seeding made.
float mt_next(inout uvec2 words, uint draw)
{
    uint next = mt_word(words.x, draw + 1);
    uint mixed = (words.x & 0x80000000u) | (next & 0x7fffffffu);
    uint y = words.y ^ (mixed >> 1) ^ ((mixed & 1u) * 0x9908b0dfu);
    y ^= y >> 11;
    y ^= (y << 7) & 0x9d2c5680u;
    y ^= (y << 15) & 0xefc60000u;
    y ^= y >> 18;
    words = uvec2(next, mt_word(words.y, draw + MT_MIDDLE + 1));
    return unit_float(y >> 8);
}

// Block 0 of a photon serves its emission, block k its bounce k - 1.
vec4 philox_block(RandomKey key, uint photon, uint block)
{
    return philox_floats(uvec4(photon, key.round, block, DOMAIN_PHOTONS), key.seed);
}

// Four dimensions of a light's sample: shuffled and scrambled by block, so that no two blocks are alike.
vec4 sobol_block(uvec2 stream, uint block)
{
    uint seed = mix32(stream.y + block);
    uvec4 point = sobol(owen_scramble(stream.x, seed));
    vec4 u;
    for (uint k = 0; k < 4; k++) {
        u[k] = unit_float(owen_scramble(point[k], mix32(seed + k + 1)) >> 8);
    }
    return u;
}

// Opens a photon's stream from its `start`: the first state of rand48, or for Sobol' points its number
// among the light's photons of the run, and the light. The others need none.
uvec2 open_stream(RandomKey key, uint photon, uvec2 start)
{
    if (RNG == RNG_RAND48) {
        return start;
    }
    if (RNG == RNG_PHILOX) {
        return uvec2(0);
    }
    uint run = mix32(key.seed.x + mix32(key.seed.y));
    if (RNG == RNG_SOBOL) {
        return uvec2(start.x, mix32(run + start.y));
    }
    return mt_open(mix32(key.photons_before + photon + run));
}

// Emission: (disc radius, disc angle, cosine, azimuth).
vec4 draw_emission(RandomKey key, uint photon, inout uvec2 stream)
{
    if (RNG == RNG_PHILOX) {
        return philox_block(key, photon, 0);
    }
    if (RNG == RNG_SOBOL) {
        return sobol_block(stream, 0);
    }
    vec4 u;
    for (uint i = 0; i < EMISSION_DRAWS; i++) {
        u[i] = RNG == RNG_RAND48 ? rand48_next(stream, key) : mt_next(stream, i);
    }
    return u;
}

// Bounce: (roulette, cosine, azimuth).
vec3 draw_bounce(RandomKey key, uint photon, uint bounce, inout uvec2 stream)
{
    if (RNG == RNG_PHILOX) {
        return philox_block(key, photon, bounce + 1).xyz;
    }
    if (RNG == RNG_SOBOL) {
        return sobol_block(stream, bounce + 1).xyz;
    }
    uint first = EMISSION_DRAWS + BOUNCE_DRAWS * bounce;
    vec3 u;
    for (uint i = 0; i < BOUNCE_DRAWS; i++) {
        u[i] = RNG == RNG_RAND48 ? rand48_next(stream, key) : mt_next(stream, first + i);
    }
    return u;
}
