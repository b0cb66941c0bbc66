// A counter-based random number generator. Twin of src/rng.rs.

// The top 24 bits as a number in [0, 1): every value is exact in f32 and none rounds up to 1.
float unit_float(uint bits24)
{
    return float(bits24) * (1.0 / 16777216.0);
}

// Philox4x32-10 (Salmon et al. 2011).
uvec4 philox(uvec4 counter, uvec2 key)
{
    for (uint i = 0; i < 10; i++) {
        uint high0, low0, high1, low1;
        umulExtended(0xd2511f53u, counter.x, high0, low0);
        umulExtended(0xcd9e8d57u, counter.z, high1, low1);
        counter = uvec4(high1 ^ counter.y ^ key.x, low1, high0 ^ counter.w ^ key.y, low0);
        key += uvec2(0x9e3779b9u, 0xbb67ae85u);
    }
    return counter;
}

// Four numbers in [0, 1) for each value of the counter.
vec4 philox_floats(uvec4 counter, uvec2 key)
{
    uvec4 bits = philox(counter, key) >> 8;
    return vec4(unit_float(bits.x), unit_float(bits.y), unit_float(bits.z), unit_float(bits.w));
}
