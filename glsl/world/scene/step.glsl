// One flight of a photon in a scene of triangles: nearest surface, Russian roulette, scatter.

#include "world/step.glsl"

Step no_step()
{
    return Step(false, false, false, false, Photon(vec3(0.0), 0, vec3(0.0), 0));
}

Step step_path(inout LightPath path, uint bounce)
{
    Step taken = no_step();
    Hit hit = closest_hit(path.position, path.direction);
    taken.escaped = hit.triangle == NONE;
    if (!taken.escaped) {
        vec3 wo = -path.direction;
        Surface surface = surface_at(hit, wo);
        bool specular = is_specular(surface);
        taken.stored = !specular && (path.arrival & push.map.stored) != 0;
        taken.photon = Photon(surface.position, surface.plane, path.flux, pack_direction(wo, findLSB(path.arrival)));

        vec4 u = philox_floats(uvec4(path.photon, push.draws.round, EMISSION_BLOCKS + bounce, push.draws.domain), push.draws.seed);
        Scatter scatter = sample_scatter(surface, wo, u.yzw, bounce, false, 0.0);
        vec3 flux = path.flux * scatter.weight;
        if (HAS_SMOOTH_NORMALS) {
            // Mirrors and glass keep a photon's flux whatever their normals: all that meets the mesh goes on.
            if (surface.ns != surface.ng && !specular) {
                float gain = shading_gain(dot(wo, surface.ns), dot(wo, surface.ng));
                float back_gain = shading_gain(dot(scatter.direction, surface.ng), dot(scatter.direction, surface.ns));
                flux *= min(gain * back_gain, float(MAX_SHADING_GAIN));
            }
        }
        vec3 start = offset_origin(surface.position, surface.error, surface.ng, scatter.direction);
        // Before the cuts below, which would hide what is no number.
        note_unless(is_finite(taken.photon.position) && is_finite(taken.photon.flux) && is_finite(start) && is_finite(scatter.direction)
                        && is_finite(flux), NONFINITE_PHOTON, push.draws.domain, push.draws.round, path.photon);
        float before = max(path.flux.x, max(path.flux.y, path.flux.z));
        float after = max(flux.x, max(flux.y, flux.z));
        // Survival in proportion to the flux that is left, so that survivors carry about what they did.
        float survival = before > 0.0 ? min(divide(after, before), 1.0) : 0.0;
        taken.alive = surface.scatters && scatter.alive && u.x < survival && (specular || push.map.caustic_only == 0);
        taken.absorbed = !taken.alive;
        flux = divide(flux, max(survival, 1e-12));
        if (HAS_SMOOTH_NORMALS) {
            vec3 clamped = min(flux, vec3(float(MAX_SHADING_GAIN)));
            if (taken.alive && clamped != flux) {
                count_loss(TOTAL_CLAMPED, flux - clamped);
            }
            flux = clamped;
        }

        uint onward = ARRIVED_INDIRECT;
        if (specular) {
            bool wanted = ((push.map.caustic_surfaces >> surface.kind) & 1u) != 0;
            onward = path.arrival >= ARRIVED_INDIRECT ? path.arrival : (wanted ? ARRIVED_CAUSTIC : ARRIVED_UNWANTED);
        }
        path = LightPath(start, path.photon, scatter.direction, onward, flux);
    }
    return taken;
}
