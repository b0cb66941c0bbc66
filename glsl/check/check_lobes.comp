// The lobes of layered surfaces: sampled, and as they weigh light from where the sample goes.
// Dispatched by tests/materials/lobe_sampling.rs. One thread = one sample; each case has equally many.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

// A layered surface as `glsl/check/check_lobes.comp` sees it.
struct LobeCase {
    // Unit vectors: towards the eye, and normals on its side.
    vec3 wo;
    vec3 ng;
    vec3 ns;
    vec3 coat_normal;
    vec3 base_colour;
    float metallic;
    float alpha;
    uint is_stretched;
    float alpha_along;
    vec3 tangent;
    float ior;
    float specular;
    float transmission;
    uint is_solid;
    // Index of refraction where wo is, over that beyond.
    float eta;
    float coat;
    float coat_alpha;
    vec3 sheen;
    float sheen_alpha;
    float diffuse_transmission;
    vec3 diffuse_transmission_colour;
    float iridescence;
    float film_ior;
    float film_thickness;
    float film_bound;
    float coverage;
    // The only lobe that has a chance; NONE: all have.
    uint lobe;
    // Radiance is carried, as by a camera path, and no flux.
    uint carries_radiance;
    // Of random numbers.
    uint seed;
};

// A sample of its lobes, and how they weigh light from there.
struct LobeSample {
    vec3 direction;
    vec3 weight;
    float density;
    uint is_alive;
    uint is_sharp;
    uint passes;
    // The chosen one, where the path does not pass, and its probability.
    uint lobe;
    float chance;
    // BRDF times cosine.
    vec3 rough;
    vec3 sharp;
};

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
#include "material/bsdf.glsl"

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
                                uint(scatter.passes), chosen.lobe, chosen.chance, light.rough, light.sharp);
}
