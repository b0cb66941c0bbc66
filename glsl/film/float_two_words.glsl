// How the paper's box adds to a film of two words, behind two_words.glsl: integers, or with SUMS_F32 a 32-bit
// float in the low word, which any device can add to by comparing bits.

// A value more in the sum of one invocation, which is kept as a film sum is. film_scale is a power of two, so
// that the product is exact.
uvec2 add_value(uvec2 sum, float value)
{
    if (SUMS == SUMS_F32) {
        return uvec2(floatBitsToUint(uintBitsToFloat(sum.x) + value * push.film_scale), 0);
    }
    return add_words(sum, to_fixed_point(value, push.film_scale));
}

void add_sum(uint sum, uvec2 amount)
{
    if (SUMS != SUMS_F32) {
        add_to_film(sum, amount);
        return;
    }
    // Whoever finds other bits than expected lost against an addition that went in, and tries again on top of it.
    uint expected;
    uint found = film[2 * sum];
    do {
        expected = found;
        float total = uintBitsToFloat(expected) + uintBitsToFloat(amount.x);
        found = atomicCompSwap(film[2 * sum], expected, floatBitsToUint(total));
    } while (found != expected);
}
