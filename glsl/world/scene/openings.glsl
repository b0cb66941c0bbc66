// Openings that light from beyond the scene comes through: a few spheres that a trial found (src/scene/openings.rs). Shadow rays and photons
// are aimed at them, but for a share that is not: so none is impossible, and each weighs by the density of both ways together (the balance
// heuristic, Veach 1997, section 9.2).

// A sphere around surfaces that make caustics, which photons are aimed at.
struct CausticTarget {
    vec3 centre;
    float radius;
};

// Of radius 0: there are no more.
layout(set = 0, binding = 13, scalar) readonly buffer Openings { CausticTarget openings[]; };

// Of photons, and of shadow rays that no table chooses. Twin of src/scene/openings.rs.
const float OPENING_SHARE = 0.75;
// Of the light samples that the table of a sky chooses without openings, those that it always has: an opening that a trial has missed
// beside a larger one may show the sun.
const float LEAST_BY_TABLE = 0.25;

// Versine of half the angle that an opening takes up as seen from a place; 0 if the place lies in it.
float opening_versine(uint opening, vec3 position)
{
    vec3 way = openings[opening].centre - position;
    float squared = dot(way, way);
    float radius = openings[opening].radius;
    float sine_squared = divide(radius * radius, max(squared, 1e-30));
    return sine_squared < 1.0 ? divide(sine_squared, 1.0 + sqrt(1.0 - sine_squared)) : 0.0;
}

// A direction, and its density, 1/sr.
struct SampledSky {
    vec3 wi;
    float density;
    bool is_aimed; // it leads to an opening, by whichever way it was found
};

float sum_of_versines(vec3 position)
{
    float sum = 0.0;
    for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
        sum += opening_versine(k, position);
    }
    return sum;
}

// Density of samples of which a share is aimed at the openings, whose versines have this sum, and the others follow the cosine.
SampledSky density_with_cones(vec3 position, vec3 ns, vec3 wi, float share, float sum)
{
    float density = (1.0 - share) * cosine_density(ns, wi);
    bool is_aimed = false;
    if (share > 0.0) {
        float cones = 0.0;
        for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
            float own = opening_versine(k, position);
            cones += own > 0.0 && versine_between(wi, normalize(openings[k].centre - position)) <= own ? 1.0 : 0.0;
        }
        density += divide(share * cones, 6.28318530717958648 * sum);
        is_aimed = cones > 0.0;
    }
    return SampledSky(wi, density, is_aimed);
}

// From 0 where two cones share no direction to 1 where the narrower one lies in the other, by the versines of their half angles and of the
// angle between their axes.
float overlap_of_cones(float a, float b, float between)
{
    float sines = sqrt(a * (2.0 - a) * b * (2.0 - b));
    // Both half angles together are half a turn, or one of them is none.
    return a + b >= 2.0 || sines < 1e-12 ? 1.0 : clamp(divide(1.0 - (1.0 - a) * (1.0 - b) + sines - between, 2.0 * sines), 0.0, 1.0);
}

// Share of light samples that the table of a sky chooses: few where no opening that is known shows the brightest part of the picture.
float table_share(Emitter sky, vec3 position)
{
    float share = LEAST_BY_TABLE * sky.outer_versine;
    if (HAS_SKY_PICTURE) {
        for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
            float own = opening_versine(k, position);
            float overlap = 1.0;
            if (own > 0.0) {
                overlap = overlap_of_cones(own, sky.sun_versine, versine_between(sky.direction, normalize(openings[k].centre - position)));
            }
            share = max(share, overlap * sky.outer_versine);
        }
    }
    return share;
}

// By the picture's table, towards the openings, or by the cosine. Aimed samples are a share of those that the table leaves, so that a sun
// that emits in has as many as without openings.
SampledSky sample_sky(Emitter sky, vec3 position, vec3 ns, vec2 u)
{
    float sum = sum_of_versines(position);
    float share = sum > 0.0 ? OPENING_SHARE : 0.0;
    float by_table = table_share(sky, position);
    if (HAS_SKY_PICTURE) {
        if (u.x < by_table) {
            SkySample found = sample_sky_table(sky, vec2(divide(u.x, by_table), u.y));
            SampledSky sampled = density_with_cones(position, ns, found.wi, share, sum);
            sampled.density = (1.0 - by_table) * sampled.density + by_table * found.density;
            return sampled;
        }
        u.x = divide(u.x - by_table, 1.0 - by_table);
    }
    vec3 wi;
    if (u.x < share) {
        float left = divide(u.x, share) * sum;
        uint chosen = 0;
        float versine = 0.0;
        for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
            float own = opening_versine(k, position);
            if (own > 0.0 && (versine == 0.0 || left >= 0.0)) {
                chosen = k;
                versine = own;
                u.x = clamp(divide(left, own), 0.0, 1.0);
            }
            left -= own;
        }
        versine *= u.x;
        wi = to_frame(direction_at(1.0 - versine, versine * (2.0 - versine), u.y), normalize(openings[chosen].centre - position));
    } else {
        wi = to_frame(sample_cosine_hemisphere(divide(u.x - share, 1.0 - share), u.y), ns);
    }
    SampledSky sampled = density_with_cones(position, ns, wi, share, sum);
    sampled.density = density_with_table(sky, by_table, wi, sampled.density);
    return sampled;
}

// Moves a photon from beyond the scene, which keeps its direction: it starts on the discs that cover the openings, or stays.
// u = (which, two for the disc).
void aim_at_openings(inout Emission emission, float scene_radius, vec3 u)
{
    float whole = scene_radius * scene_radius;
    float sum = 0.0;
    for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
        sum += openings[k].radius * openings[k].radius;
    }
    if (sum == 0.0 || sum >= whole) {
        return;
    }
    if (u.x < OPENING_SHARE) {
        float left = divide(u.x, OPENING_SHARE) * sum;
        uint chosen = 0;
        for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
            chosen = left >= 0.0 ? k : chosen;
            left -= openings[k].radius * openings[k].radius;
        }
        CausticTarget opening = openings[chosen];
        vec3 centre = opening.centre - (dot(opening.centre, emission.direction) + 2.0 * scene_radius) * emission.direction;
        emission.position = sample_disc(centre, emission.direction, opening.radius, u.yz);
    }
    float discs = 0.0;
    for (uint k = 0; k < MAX_OPENINGS && openings[k].radius > 0.0; k++) {
        vec3 off = cross(emission.position - openings[k].centre, emission.direction);
        discs += dot(off, off) <= openings[k].radius * openings[k].radius ? 1.0 : 0.0;
    }
    emission.flux *= divide(1.0, 1.0 - OPENING_SHARE + divide(OPENING_SHARE * discs * whole, sum));
}
