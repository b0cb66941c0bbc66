// Spread of a sum over blocks, from the sum and the squares of what each block left.
// Expects math/math.glsl and film/wide.glsl.

uvec4 times32(uvec4 a, uint b)
{
    uvec4 product = uvec4(0);
    uint carry = 0;
    for (uint word = 0; word < 4; word++) {
        uint high, low, over;
        umulExtended(a[word], b, high, low);
        product[word] = uaddCarry(low, carry, over);
        carry = high + over;
    }
    return product;
}

// a - b, of which a is the larger.
uvec4 subtract128(uvec4 a, uvec4 b)
{
    uvec4 difference;
    uint borrow = 0;
    for (uint word = 0; word < 4; word++) {
        uint b0, b1;
        uint partial = usubBorrow(a[word], b[word], b0);
        difference[word] = usubBorrow(partial, borrow, b1);
        borrow = b0 + b1;
    }
    return difference;
}

float float_of_wide(uvec4 a)
{
    const float WORD = 4294967296.0;
    return ((float(a.w) * WORD + float(a.z)) * WORD + float(a.y)) * WORD + float(a.x);
}

// Unbiased variance of the sum; 0 of fewer than two blocks. Twin of `BlockSums::variance`. Sums are at most 2^63, so that no product
// exceeds 128 bits; the subtraction is exact, as floats cannot hold the small spread of large sums.
float variance_of_sum(uvec2 sum, uvec4 squares, uint blocks)
{
    if (blocks < 2) {
        return 0.0;
    }
    return divide(float_of_wide(subtract128(times32(squares, blocks), square64(sum))), float(blocks - 1));
}
