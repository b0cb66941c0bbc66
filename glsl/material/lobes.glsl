// How surfaces weigh light that arrives.

#include "material/phong_lobe.glsl"

vec3 mirrored(vec3 w, vec3 n)
{
    return 2.0 * dot(w, n) * n - w;
}

// The factor in front of a surface's lobe: f = scale * lobe_weight.
float scatter_scale(uint kind, float exponent)
{
    return kind == SURFACE_GLOSSY ? (exponent + 2.0) * 0.15915494309189535 : 0.31830988618379067;
}

// Whether a surface weighs light by its direction.
bool has_lobe(uint kind)
{
    bool has = false;
    if (HAS_GLOSSY) {
        has = has || kind == SURFACE_GLOSSY;
    }
    if (HAS_PAPER_PHONG) {
        has = has || kind == SURFACE_PAPER_PHONG;
    }
    if (HAS_LAYERS) {
        has = has || kind == SURFACE_LAYERED;
    }
    return has;
}

// How a lobe weighs light from wi towards wo; 1 on a Lambertian surface.
float lobe_weight(uint kind, float exponent, vec3 ns, vec3 wo, vec3 wi)
{
    // Layered surfaces weigh light by matt_brdf().
    if (!has_lobe(kind) || kind == SURFACE_LAYERED) {
        return 1.0;
    }
    vec3 mirror = mirrored(wi, ns);
    // Half the squared distance of two unit vectors: 1 less the rounded cosine has no digits left in a narrow lobe.
    vec3 apart = wo - mirror;
    return phong_lobe(dot(mirror, wo), 0.5 * dot(apart, apart), exponent);
}

// What a shading normal changes about a photon's flux (Veach 1997, section 5.3): the ratio of the cosines
// that the light sees to those that the eye sees.
float shading_gain(float shading_cosine, float geometric_cosine)
{
    return min(divide(abs(shading_cosine), max(abs(geometric_cosine), 1e-6)), float(MAX_SHADING_GAIN));
}
