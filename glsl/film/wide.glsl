// Integers of 64 bits (low word, high word) and of 128 bits (lowest word first), for sums of squares that no round
// may lose a bit of.

uvec2 add64(uvec2 a, uvec2 b)
{
    uint carry;
    a.x = uaddCarry(a.x, b.x, carry);
    a.y += b.y + carry;
    return a;
}

uvec4 add128(uvec4 a, uvec4 b)
{
    uvec4 sum;
    uint carry = 0;
    for (uint word = 0; word < 4; word++) {
        uint c0, c1;
        uint partial = uaddCarry(a[word], b[word], c0);
        sum[word] = uaddCarry(partial, carry, c1);
        carry = c0 + c1;
    }
    return sum;
}

uvec4 square64(uvec2 a)
{
    uint h0, l0, h1, l1, h2, l2;
    umulExtended(a.x, a.x, h0, l0);
    umulExtended(a.x, a.y, h1, l1);
    umulExtended(a.y, a.y, h2, l2);
    uvec4 square = uvec4(l0, h0, l2, h2);
    uvec4 middle = uvec4(0, l1, h1, 0);
    return add128(add128(square, middle), middle);
}
