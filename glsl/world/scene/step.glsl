// One flight of a photon in a scene of triangles: nearest surface, Russian roulette, scatter.

#include "world/step.glsl"

// Of a photon's random numbers: behind those of its bounces.
const uint CHANNEL_BLOCK = EMISSION_BLOCKS + MAX_BOUNCES;

Step no_step()
{
    return Step(false, false, false, false, Photon(vec3(0.0), 0, vec3(0.0), 0));
}

Step step_path(inout PhotonState path, uint bounce)
{
    Step taken = no_step();
    Hit hit = closest_hit(path.position, path.direction);
    taken.escaped = hit.triangle == NONE;
    if (!taken.escaped) {
        vec3 arriving = path.flux;
        if (HAS_MEDIA) {
            arriving *= transmittance(path.media, hit.t);
        }
        vec3 wo = -path.direction;
        Surface surface = surface_at(hit, wo);
        bool is_layered = has_layers(surface.kind);
        Lobes lobes;
        bool has_rough = keeps_photons(triangles[hit.triangle].material);
        vec3 entering = arriving;
        if (is_layered) {
            uint channel = 1;
            if (HAS_DISPERSION && is_dispersive(surface, path.media)) {
                // Once a path: of one channel it stays.
                uvec4 block = uvec4(path.photon, push.draws.round, CHANNEL_BLOCK, push.draws.domain);
                channel = choose_channel(arriving, philox_floats(block, push.draws.seed).x);
                entering = light_of_channel(arriving, channel);
            }
            lobes = lobes_at(surface, wo, path.media, channel, bounce);
            has_rough = has_rough && surface.scatters;
        }
        // Also where alpha has a gap: the light there is that of the surface about it, whose area the density estimate counts.
        taken.stored = has_rough && (path.arrival & push.map.stored) != 0;
        taken.photon = Photon(surface.position, surface.plane, arriving, pack_direction(wo, findLSB(path.arrival)));

        vec4 u = philox_floats(uvec4(path.photon, push.draws.round, EMISSION_BLOCKS + bounce, push.draws.domain), push.draws.seed);
        Scatter scatter = sample_surface(surface, lobes, wo, u.yzw, bounce, false);
        if (HAS_PASSING && is_layered) {
            scatter.weight *= scatter.passes ? 1.0 : divide(surface.layers.coverage, 1.0 - lobes.pass_chance);
        }
        bool specular = scatter.is_specular;
        vec3 flux = entering * scatter.weight;
        if (HAS_SMOOTH_NORMALS) {
            // Mirrors and glass keep a photon's flux whatever their normals: all that meets the mesh goes on.
            bool keeps_flux = scatter.passes || (specular && scatter.density == 0.0);
            if (surface.ns != surface.ng && !keeps_flux) {
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
        bool may_scatter = surface.scatters || scatter.passes;
        taken.alive = may_scatter && scatter.alive && u.x < survival && (specular || scatter.passes || push.map.caustic_only == 0);
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
        if (scatter.passes) {
            onward = path.arrival;
        } else if (specular) {
            uint kind = surface.kind;
            if (is_layered) {
                kind = dot(scatter.direction, surface.ng) < 0.0 ? SURFACE_DIELECTRIC : SURFACE_MIRROR;
            }
            bool wanted = ((push.map.caustic_surfaces >> kind) & 1u) != 0;
            onward = path.arrival >= ARRIVED_INDIRECT ? path.arrival : (wanted ? ARRIVED_CAUSTIC : ARRIVED_UNWANTED);
        }
        uint media = path.media;
        if (HAS_MEDIA && is_layered && specular && surface.layers.medium != 0 && dot(scatter.direction, surface.ng) < 0.0) {
            media = media_beyond(surface, media);
        }
        path = PhotonState(start, path.photon, scatter.direction, onward, flux, media);
    }
    return taken;
}
