// Rounding of light to integers that is right on average, however far below a unit it lies: a fraction is rounded up with
// a probability of its own size (stochastic rounding). So a channel that is dim beside the others keeps its light, and what
// rounding adds shows between rounds as noise does.
//
// What decides is a hash of the round and of what is rounded, the same for all channels: sums stay the same to the bit in
// whatever order and by whatever invocation they are made, and grey stays grey.

#include "rng/hash.glsl"

// The bits of a position, mixed.
uint position_bits(vec3 position)
{
    uvec3 bits = floatBitsToUint(position);
    return bits.x * 0x9e3779b1u + bits.y * 0x85ebca77u + bits.z * 0xc2b2ae3du;
}

// A number from 0 to below 1: a value that it is added to is rounded up, by dropping what is behind the point, as often as its
// fraction says, to some 2^-24.
float chance_of(uint bits)
{
    return float(bits >> 8) * (1.0 / 16777216.0);
}

// 1 if a fraction, 0 to below 1, is rounded up. Both products are exact.
uint round_up(float fraction, uint chance)
{
    return chance < uint(fraction * 4294967296.0) ? 1 : 0;
}
