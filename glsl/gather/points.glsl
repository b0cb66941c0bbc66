// Points of the paper's box, and what a dispatch that estimates the light there is given.

// A point at which light is estimated.
struct Point {
    vec3 position;
    uint wall;
};

struct GatherPush {
    // Points `first_point` to `end_point` - 1 and slices from `first_slice` on: what one dispatch
    // covers.
    uint first_point;
    uint end_point;
    uint first_slice;
    uint photon_capacity;
    float radius_squared;
    // A little over the radius: how far from the point a cell may lie.
    float reach;
    // Fixed-point units in 1.
    float film_scale;
    vec3 origin;
    float cells_per_metre;
    uvec3 cell_count;
};
