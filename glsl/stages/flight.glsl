// One flight of every photon in a scene of triangles: nearest surface, store, Russian roulette, scatter.
// The including kernel chose how places are taken.

layout(set = 1, binding = 0, scalar) readonly buffer LightPaths { LightPath light_paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextLightPaths { LightPath next_light_paths[]; };
layout(set = 1, binding = 2, scalar) writeonly buffer Map { MapPhoton map[]; };

void fly()
{
    uint index = invocation_index();
    bool entered = index < min(counters[1 + push.bounce], push.path_capacity);
    bool escaped = false;
    bool absorbed = false;
    bool stored = false;
    bool alive = false;
    LightPath path;
    MapPhoton photon;
    if (entered) {
        path = light_paths[index];
        Hit hit = closest_hit(path.position, path.direction);
        escaped = hit.triangle == NONE;
        if (!escaped) {
            vec3 wo = -path.direction;
            Surface surface = surface_at(hit, wo);
            bool specular = is_specular(surface);
            stored = !specular && (path.arrival & push.stored) != 0;
            photon = MapPhoton(surface.position, pack_normal(surface.ng), path.flux, pack_direction(wo, findLSB(path.arrival)));

            vec4 u = philox_floats(uvec4(path.photon, push.draws.round, EMISSION_BLOCKS + push.bounce, push.draws.domain), push.draws.seed);
            Scatter scatter = sample_scatter(surface, wo, u.yzw, false);
            vec3 flux = path.flux * scatter.weight;
            if (HAS_SMOOTH_NORMALS) {
                if (surface.ns != surface.ng) {
                    float gain = shading_gain(dot(wo, surface.ns), dot(wo, surface.ng));
                    float back_gain = shading_gain(dot(scatter.direction, surface.ng), dot(scatter.direction, surface.ns));
                    flux *= min(gain * back_gain, float(MAX_SHADING_GAIN));
                }
            }
            vec3 start = offset_origin(surface.position, surface.error, surface.ng, scatter.direction);
            // Before the cuts below, which would hide what is no number.
            note_unless(is_finite(photon.position) && is_finite(photon.flux) && is_finite(start) && is_finite(scatter.direction)
                            && is_finite(flux), ODD_PHOTON, push.draws.domain, push.draws.round, path.photon);
            float before = max(path.flux.x, max(path.flux.y, path.flux.z));
            float after = max(flux.x, max(flux.y, flux.z));
            // Survival in proportion to the flux that is left, so that survivors carry about what they did.
            float survival = before > 0.0 ? min(divide(after, before), 1.0) : 0.0;
            alive = surface.scatters && scatter.alive && u.x < survival && (specular || push.caustic_only == 0);
            absorbed = !alive;
            flux = min(divide(flux, max(survival, 1e-12)), vec3(float(MAX_SHADING_GAIN)));

            uint onward = ARRIVED_INDIRECT;
            if (specular) {
                bool wanted = ((push.caustic_surfaces >> surface.kind) & 1u) != 0;
                onward = path.arrival >= ARRIVED_INDIRECT ? path.arrival : (wanted ? ARRIVED_CAUSTIC : ARRIVED_UNWANTED);
            }
            path = LightPath(start, path.photon, scatter.direction, onward, flux);
        }
    }
    // Full maps drop nothing: the plan gives room for every photon at every bounce.
    uint place = take_place(0, stored);
    bool dropped = stored && place >= push.photon_capacity;
    if (stored && !dropped) {
        map[place] = photon;
    }
    uint path_place = take_place(2 + push.bounce, alive);
    if (alive) {
        next_light_paths[path_place] = path;
    }
    tally(push.bounce, alive, absorbed, escaped, false);
    if (dropped) {
        atomicAdd(tallies[push.bounce].dropped, 1);
    }
}
