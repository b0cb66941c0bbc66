// Film sums as 64-bit integers, for devices with 64-bit atomics.

layout(set = 1, binding = 0, scalar) buffer Film { uint64_t film[]; };

void add_to_film(uint sum, uvec2 amount)
{
    atomicAdd(film[sum], packUint2x32(amount));
}
