// Photons within a share of the radius: what they change gives the bias of the radius (src/engine/error/bias.rs).

// 1 / sqrt(2), as `SMALLER` there.
const float NEAR_SHARE = 0.70710678118654752;

// What lies that near of visible points, all arrivals together: of the global map, then of the caustic map. Two words a sum.
layout(set = 1, binding = 21, scalar) buffer NearSums { uint near_sums[]; };

uint place_of_near(uint point, uint point_count, bool is_caustic)
{
    return 6 * (point + (is_caustic ? point_count : 0));
}

void add_to_near(uint place, uvec2 amount)
{
    uint before = atomicAdd(near_sums[place], amount.x);
    uint high = amount.y + (before > 0xffffffffu - amount.x ? 1 : 0);
    if (high != 0) {
        atomicAdd(near_sums[place + 1], high);
    }
}
