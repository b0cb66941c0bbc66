// How the paper's box adds to a film of 64-bit words, behind u64.glsl: integers, or with SUMS_COMPENSATED pairs of
// 32-bit floats, the sum in the low word and what its rounding lost in the high one.

// (sum, what its rounding lost) and one number more: Knuth's exact sum of two, and what is lost goes back into the
// sum each time (Kahan 1965), as it would itself stop growing otherwise. Twin of src/cpu/estimate.rs.
vec2 add_compensated(vec2 sum, float value)
{
    precise float rounded = sum.x + value;
    precise float part = rounded - sum.x;
    precise float rest = sum.y + ((sum.x - (rounded - part)) + (value - part));
    precise float total = rounded + rest;
    precise float lost = rest - (total - rounded);
    return vec2(total, lost);
}

// A value more in the sum of one invocation, which is kept as a film sum is. film_scale is a power of two, so
// that the product is exact.
uvec2 add_value(uvec2 sum, float value)
{
    if (SUMS == SUMS_COMPENSATED) {
        return floatBitsToUint(add_compensated(uintBitsToFloat(sum), value * push.film_scale));
    }
    return add_words(sum, to_fixed_point(value, push.film_scale));
}

void add_sum(uint sum, uvec2 amount)
{
    if (SUMS != SUMS_COMPENSATED) {
        add_to_film(sum, amount);
        return;
    }
    // Whoever finds other bits than expected lost against an addition that went in, and tries again on top of it.
    vec2 more = uintBitsToFloat(amount);
    uint64_t expected;
    uint64_t found = film[sum];
    do {
        expected = found;
        vec2 total = add_compensated(add_compensated(uintBitsToFloat(unpackUint2x32(expected)), more.y), more.x);
        found = atomicCompSwap(film[sum], expected, packUint2x32(floatBitsToUint(total)));
    } while (found != expected);
}
