// Photons of a caustic map leave their light only towards the spheres that hold the mirrors and glass whose caustics are wanted: projection maps
// (Jensen 1996, section 3) with spheres for cells. A sphere is chosen in proportion to a bound of what the light sends
// into its cone, and the photon weighs the density of the light's own law over that of all cones together (the balance
// heuristic, Veach 1997, section 9.2), so that spheres may overlap. As no law exceeds its bound, no photon weighs
// more than the sum of the bounds; where that is 1 or more, as within a sphere, photons leave as ever.

layout(set = 0, binding = 8, scalar) readonly buffer CausticTargets { CausticTarget caustic_targets[]; };

// Directions are no better known than to some of their last bits: by so much each sphere's half angle is widened, by its
// sine, and a law's reach by its cosine.
const float AIM_MARGIN = 1.0 / 1048576.0;

// Density, 1/sr, of the directions in which a light's photons leave, at a versine from its axis. None is larger further off.
float emission_density(Emitter light, float versine)
{
    float cosine = 1.0 - versine;
    if (HAS_SPOT_LIGHTS && light.kind == EMITTER_SPOT) {
        return divide(spot_falloff(light, versine), 6.28318530717958648 * spot_integral(light));
    }
    if (HAS_DISC_LIGHTS && light.kind == EMITTER_DISC_UNIFORM) {
        return cosine > 0.0 ? 0.15915494309189535 : 0.0;
    }
    if (HAS_POINT_LIGHTS && light.kind == EMITTER_POINT) {
        return 0.07957747154594767;
    }
    return max(cosine, 0.0) * 0.31830988618379067;
}

// Directions from a place of emission to a sphere.
struct Cone {
    vec3 axis;
    float versine; // of half its angle
    float density; // bound of the law's within it
    float share; // bound of the light that leaves within it; 1 where the place is in the sphere
};

Cone cone_to(CausticTarget target, Emitter light, Emission emission)
{
    vec3 way = target.centre - emission.position;
    float distance_to_centre = norm(way);
    if (distance_to_centre <= target.radius * (1.0 + AIM_MARGIN)) {
        return Cone(vec3(0.0), 2.0, 0.0, 1.0);
    }
    vec3 axis = divide(way, distance_to_centre);
    float sine = min(divide(target.radius, distance_to_centre) + AIM_MARGIN, 1.0);
    float cosine = sqrt((1.0 - sine) * (1.0 + sine));
    // Not 1 - cosine, of which nothing is left for a small sphere far off.
    float versine = divide(sine * sine, 1.0 + cosine);
    // The direction within the cone that is closest to the law's axis.
    float off = versine_between(axis, emission.axis);
    float cos_off = 1.0 - off;
    float sin_off = sqrt(max(off * (2.0 - off), 0.0));
    float cos_closest = cos_off * cosine + sin_off * sine + AIM_MARGIN;
    float density = emission_density(light, off <= versine ? 0.0 : max(1.0 - cos_closest, 0.0));
    return Cone(axis, versine, density, min(6.28318530717958648 * versine * density, 1.0));
}

// Turns a photon from a light within the scene; u = (target, two for the direction).
void aim_near(inout Emission emission, Emitter light, uint target_count, vec3 u)
{
    float sum = 0.0;
    for (uint k = 0; k < target_count; k++) {
        sum += cone_to(caustic_targets[k], light, emission).share;
    }
    if (sum >= 1.0) {
        return;
    }
    uint chosen = NONE;
    float before = 0.0;
    for (uint k = 0; k < target_count; k++) {
        float share = cone_to(caustic_targets[k], light, emission).share;
        chosen = share > 0.0 && before <= u.x * sum ? k : chosen;
        before += share;
    }
    if (chosen == NONE) {
        // Nothing that leaves this place meets a target.
        emission.flux = vec3(0.0);
        return;
    }
    Cone cone = cone_to(caustic_targets[chosen], light, emission);
    float versine = u.y * cone.versine;
    emission.direction = to_frame(direction_at(1.0 - versine, versine * (2.0 - versine), u.z), cone.axis);
    float density = 0.0;
    for (uint k = 0; k < target_count; k++) {
        Cone other = cone_to(caustic_targets[k], light, emission);
        density += k == chosen || versine_between(emission.direction, other.axis) <= other.versine ? other.density : 0.0;
    }
    emission.flux *= divide(emission_density(light, versine_between(emission.direction, emission.axis)) * sum, density);
}

// Moves a photon from beyond the scene, which keeps its direction: it starts on the discs that cover the targets
// instead of the one that covers everything. u = (target, two for the disc).
void aim_far(inout Emission emission, float scene_radius, uint target_count, vec3 u)
{
    float sum = 0.0;
    for (uint k = 0; k < target_count; k++) {
        sum += caustic_targets[k].radius * caustic_targets[k].radius;
    }
    if (sum >= scene_radius * scene_radius) {
        return;
    }
    uint chosen = 0;
    float before = 0.0;
    for (uint k = 0; k < target_count; k++) {
        chosen = before <= u.x * sum ? k : chosen;
        before += caustic_targets[k].radius * caustic_targets[k].radius;
    }
    CausticTarget target = caustic_targets[chosen];
    vec3 centre = target.centre - (dot(target.centre, emission.direction) + 2.0 * scene_radius) * emission.direction;
    emission.position = sample_disc(centre, emission.direction, target.radius, u.yz);
    float count = 0.0;
    for (uint k = 0; k < target_count; k++) {
        float radius = caustic_targets[k].radius;
        vec3 off = cross(emission.position - caustic_targets[k].centre, emission.direction);
        count += k == chosen || dot(off, off) <= radius * radius ? 1.0 : 0.0;
    }
    emission.flux *= divide(sum, scene_radius * scene_radius * count);
}
