// Where samples of pixels stand. Each pixel has `work.samples`; those of tiles whose paths vary more have others on top, and stand behind
// those of all pixels, one pixel after another.

#include "world/scene/work.glsl"

// Of this dispatch. It is no constant, so that another division needs no other pipeline; `main` sets it.
WorkDivision work = WorkDivision(1, 1, 1, 0);

// That this invocation follows a path of; `main` sets it.
Sample own = Sample(0, 0, 0, 1);

// Points that one camera path may have.
uint points_per_path()
{
    uint count = 1;
    if (GATHER_RAYS != GATHER_NONE) {
        count = 2;
    }
    return count;
}

// Points of the samples that all pixels have.
uint even_points(uint pixel_count)
{
    return points_per_path() * work.samples * pixel_count;
}

// Where point `k` of the sample at `place` stands: all pixels' first points before their second ones, so that neighbours in memory are
// neighbours in the picture; then those of extra samples.
uint place_of_point(uint k, uint place, uint pixel_count)
{
    uint even = work.samples * pixel_count;
    if (place < even) {
        uint number = place % work.samples;
        return (points_per_path() * number + k) * pixel_count + place / work.samples;
    }
    return even_points(pixel_count) + k * work.extra_samples + place - even;
}
