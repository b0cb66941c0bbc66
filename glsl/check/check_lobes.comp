// The lobes of layered surfaces: sampled, and as they weigh light from where the sample goes.
// Dispatched by tests/materials/lobe_sampling.rs. One thread = one sample; each case has equally many.
#extension GL_EXT_control_flow_attributes : require
#include "records.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Cases { LobeCase cases[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Results { LobeSample results[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"
#include "rng/sampling.glsl"
#include "world/scene/effects.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "material/surface.glsl"
#include "material/lobes.glsl"
#include "material/scatter.glsl"

Surface surface_of(LobeCase at)
{
    Surface surface;
    surface.position = vec3(0.0);
    surface.error = 0.0;
    surface.plane = 0;
    surface.ng = at.ng;
    surface.ns = at.ns;
    surface.front = true;
    surface.scatters = true;
    surface.kind = SURFACE_LAYERED;
    surface.parameter = 0.0;
    surface.base_colour = at.base_colour;
    surface.emission = vec3(0.0);
    surface.layers = Layers(at.metallic, at.alpha, at.is_stretched != 0, at.alpha_along, at.tangent, at.ior, 0.0, at.specular, vec3(1.0), at.transmission, at.is_solid != 0, 0,
                            at.diffuse_transmission, at.diffuse_transmission_colour, at.iridescence, at.film_ior, at.film_thickness, at.film_bound,
                            at.coat, at.coat_alpha, at.coat_normal, at.sheen,
                            at.sheen_alpha, at.coverage, false);
    return surface;
}

void main()
{
    uint index = invocation_index();
    uint count = uint(results.length());
    if (index >= count) {
        return;
    }
    LobeCase at = cases[index / (count / uint(cases.length()))];
    Surface surface = surface_of(at);
    Lobes lobes = lobes_of(surface, at.wo, at.eta);
    if (at.lobe != NONE) {
        lobes.diffuse_chance = at.lobe == LOBE_DIFFUSE ? lobes.diffuse_chance : 0.0;
        lobes.sheen_chance = at.lobe == LOBE_SHEEN ? lobes.sheen_chance : 0.0;
        lobes.reflection_chance = at.lobe == LOBE_REFLECTION ? lobes.reflection_chance : 0.0;
        lobes.coat_chance = at.lobe == LOBE_COAT ? lobes.coat_chance : 0.0;
        lobes.beyond_chance = at.lobe == LOBE_DIFFUSE_TRANSMISSION ? lobes.beyond_chance : 0.0;
        lobes.transmission_chance = at.lobe == LOBE_TRANSMISSION ? lobes.transmission_chance : 0.0;
    }
    vec3 u = philox_floats(uvec4(index, 0, 0, 0), uvec2(at.seed, 4)).xyz;
    Scatter scatter = sample_layered(surface, lobes, at.wo, u, at.carries_radiance != 0);
    ChosenLobe chosen = choose_lobe(lobes, u.x);
    LobeLight light = weigh_light(surface, lobes, at.wo, scatter.direction, 0.0, false);
    results[index] = LobeSample(scatter.direction, scatter.weight, scatter.density, uint(scatter.alive), uint(scatter.is_specular),
                                uint(scatter.passes), chosen.lobe, chosen.chance, light.matt, light.sharp);
}
