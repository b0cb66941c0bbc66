// Points that fall more evenly than chance. Twin of src/rng.rs.

// Point `index` of the Sobol' sequence as fractions of 2^32: the first four dimensions of Joe and Kuo
// (2008). Direction numbers follow from the recurrences of their polynomials, 1, x + 1, x^2 + x + 1
// and x^3 + x + 1; those of the next bit stand first.
uvec4 sobol(uint index)
{
    uvec4 point = uvec4(bitfieldReverse(index), 0, 0, 0);
    uint second = 0x80000000u;
    uvec2 third = uvec2(0x80000000u, 0xc0000000u);
    uvec3 fourth = uvec3(0x80000000u, 0xc0000000u, 0x20000000u);
    for (; index != 0; index >>= 1) {
        if ((index & 1u) == 1) {
            point.yzw ^= uvec3(second, third.x, fourth.x);
        }
        second ^= second >> 1;
        third = uvec2(third.y, third.y ^ third.x ^ (third.x >> 2));
        fourth = uvec3(fourth.y, fourth.z, fourth.y ^ fourth.x ^ (fourth.x >> 3));
    }
    return point;
}

// Owen's scrambling by a hash (Burley 2020, listing 3): each bit is flipped or not by the bits above
// it and the seed. Of an index, it shuffles every aligned block of 2^k among such blocks.
uint owen_scramble(uint x, uint seed)
{
    x = bitfieldReverse(x) + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return bitfieldReverse(x);
}
