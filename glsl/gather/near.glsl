// Photons within a share of the radius: what they change tells the bias of the radius (src/engine/bias.rs).

// 1 / sqrt(2), as `SMALLER` there.
const float NEAR_SHARE = 0.70710678118654752;

// Which sums of visible points hold what lies that near, of the global and of the caustic map: behind those of the arrivals.
uint near_set(bool is_caustic)
{
    uint arrival_sets = 2;
    if (HAS_ALL_ARRIVALS) {
        arrival_sets = 3;
    }
    return arrival_sets + (is_caustic ? 1 : 0);
}
