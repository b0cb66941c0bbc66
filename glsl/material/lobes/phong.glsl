// The modified Phong lobe of glossy surfaces (Lafortune and Willems 1994), and the lobe by which the paper weighs what leaves to the eye.

#include "rng/sampling.glsl"
#include "math/directions.glsl"
#include "material/layers.glsl"
#include "material/phong_lobe.glsl"
#include "material/scatter.glsl"

// The factor in front of a surface's lobe: f = scale * lobe_weight.
float scatter_scale(uint kind, float exponent)
{
    return kind == SURFACE_GLOSSY ? (exponent + 2.0) * 0.15915494309189535 : 0.31830988618379067;
}

// Whether a surface weighs light by its direction.
bool has_lobe(uint kind)
{
    return (HAS_GLOSSY && kind == SURFACE_GLOSSY) || (HAS_PAPER_PHONG && kind == SURFACE_PAPER_PHONG) || (HAS_LAYERS && kind == SURFACE_LAYERED);
}

// How a lobe weighs light from wi towards wo; 1 on a Lambertian surface.
float lobe_weight(uint kind, float exponent, vec3 ns, vec3 wo, vec3 wi)
{
    // Layered surfaces weigh light by rough_brdf().
    if (!has_lobe(kind) || kind == SURFACE_LAYERED) {
        return 1.0;
    }
    vec3 mirror = mirrored(wi, ns);
    // Half the squared distance of two unit vectors: 1 less the rounded cosine has no digits left in a narrow lobe.
    vec3 apart = wo - mirror;
    return phong_lobe(dot(mirror, wo), 0.5 * dot(apart, apart), exponent);
}

Scatter sample_glossy(Surface surface, vec3 wo, vec2 u)
{
    float n = surface.parameter;
    vec3 wi = to_frame(sample_lobe(n, u.x, u.y), mirrored(wo, surface.ns));
    float cos_out = dot(wi, surface.ns);
    vec3 weight = surface.base_colour * (divide(n + 2.0, n + 1.0) * max(cos_out, 0.0));
    return Scatter(wi, weight, cos_out > 0.0 && dot(wi, surface.ng) > 0.0, false, false, 0.0);
}
