// Film sums as two 32-bit words, for devices without 64-bit atomics. Every wrap of the low word
// carries exactly one into the high word, in whatever order the additions come.

layout(set = 1, binding = 0, scalar) buffer Film { uint film[]; };

void add_to_film(uint sum, uvec2 amount)
{
    uint low_before = atomicAdd(film[2 * sum], amount.x);
    uint carry = low_before > 0xffffffffu - amount.x ? 1 : 0;
    if (amount.y + carry != 0) {
        atomicAdd(film[2 * sum + 1], amount.y + carry);
    }
}
