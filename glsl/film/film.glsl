// Integer sums of the film. u64.glsl and two_words.glsl each define
//
//   void add_to_film(uint sum, uvec2 amount)
//       adds the 64-bit integer `amount` (low word, high word) to film sum number `sum`.
//
// Both lay the sums out alike, low word first, so nothing else knows which one ran.

layout(constant_id = 6) const uint CHANNEL_COUNT = 1;
// How the paper's box adds; see float_two_words.glsl and float_u64.glsl.
layout(constant_id = 36) const uint SUMS = SUMS_INTEGER;

// What one photon adds to a channel, in the film's fixed-point unit, rounded once: value lies in [0, 1]
// and film_scale is a power of two up to 2^31, so the product is exact and fits 32 bits.
uint to_fixed_point(float value, float film_scale)
{
    return uint(roundEven(value * film_scale));
}

uvec2 add_words(uvec2 sum, uint amount)
{
    uint carry;
    sum.x = uaddCarry(sum.x, amount, carry);
    sum.y += carry;
    return sum;
}
