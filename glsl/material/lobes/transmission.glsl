// What the dielectric transmits by its facets: into a solid it is refracted, through a thin wall it goes straight on, and spreads as what
// is reflected does.

#include "material/lobes/reflection.glsl"

const float SAME_INDEX = 1e-4;

// Smooth normals do not keep phase space: without an end, some of what enters a coarse ball of glass is reflected in it for ever. What
// enters a solid by its triangles alone also leaves it. The path has met `depth` surfaces before.
vec3 normal_of_refraction(Surface surface, vec3 wo, float eta, uint depth)
{
    bool is_trapped = false;
    if (HAS_SMOOTH_NORMALS) {
        is_trapped = depth >= SMOOTH_TOTAL_REFLECTIONS && surface.layers.is_solid && surface.layers.transmission > 0.0
                  && surface.layers.alpha < DELTA_ALPHA && refracted_cosine_squared(min(dot(wo, surface.ns), 1.0), eta) <= 0.0;
    }
    return is_trapped ? surface.ng : surface.ns;
}

// Into a solid of the same index.
bool goes_straight(Layers layers, Lobes lobes)
{
    return layers.is_solid && abs(lobes.base.eta - 1.0) < SAME_INDEX;
}

bool is_smooth_transmission(Layers layers, Lobes lobes)
{
    return lobes.transmission_chance > 0.0 && (layers.alpha < DELTA_ALPHA || goes_straight(layers, lobes));
}

vec3 transmission_colour(Lobes lobes, vec3 exact)
{
    return lobes.transmitted * (1.0 - exact);
}

// Share of light from wo that is transmitted, as far as coat and sheen leave it.
vec3 transmission_along(Lobes lobes, Layers layers, vec3 exact)
{
    if (HAS_TRANSMISSION && layers.transmission > 0.0) {
        vec3 transmitted = transmission_colour(lobes, exact);
        // Facets let light through where the surface as a whole would not.
        return layers.alpha >= DELTA_ALPHA ? max(transmitted, 0.125 * lobes.transmitted) : transmitted;
    }
    return vec3(0.0);
}

// Refraction of Walter et al. (2007), of radiance towards wo.
Weighed weigh_refraction(Facets facets, float eta, vec3 wo, vec3 wi)
{
    float cos_l = -dot(wi, facets.n), cos_v = dot(wo, facets.n);
    // On the side of wo: eta wo + wi points away from the rarer medium.
    vec3 h = eta * wo + wi;
    float squared = dot(h, h);
    if (cos_l <= 0.0 || cos_v <= 0.0 || squared < 1e-12) {
        return Weighed(0.0, 0.0, 1.0);
    }
    h *= inversesqrt(squared);
    h = dot(h, facets.n) < 0.0 ? -h : h;
    float v_h = dot(wo, h), l_h = -dot(wi, h);
    if (v_h <= 0.0 || l_h <= 0.0) {
        return Weighed(0.0, 0.0, 1.0);
    }
    float density = facet_density(facets, to_facets(facets, h));
    float spread = eta * v_h - l_h;
    float jacobian = divide(l_h, max(spread * spread, 1e-12));
    float both = density * v_h * jacobian;
    float value = eta * eta * both * 4.0 * facet_visibility(facets, wi, wo, cos_l, cos_v) * cos_l;
    return Weighed(value, both * facet_masking(facets, wo, cos_v), v_h);
}

Weighed weigh_transmission(Surface surface, Lobes lobes, vec3 wo, vec3 wi)
{
    if (surface.layers.is_solid) {
        return weigh_refraction(base_facets(surface), lobes.base.eta, wo, wi);
    }
    // A thin wall transmits as it would reflect the mirrored direction.
    return weigh_reflection(base_facets(surface), wo, wi - 2.0 * dot(wi, surface.ns) * surface.ns);
}

// Where it goes on that is transmitted; nowhere in total reflection.
vec3 transmit_at_facet(Surface surface, Lobes lobes, inout SampledFacet facet, vec3 wo)
{
    if (!surface.layers.is_solid) {
        vec3 wi = reflect_at_facet(facet, wo);
        return wi - 2.0 * dot(wi, surface.ns) * surface.ns;
    }
    float eta = lobes.base.eta;
    float cos_t_squared = refracted_cosine_squared(facet.along, eta);
    float l_h = sqrt(max(cos_t_squared, 0.0));
    float spread = eta * facet.along - l_h;
    facet.density *= facet.along * divide(l_h, max(spread * spread, 1e-12));
    if (goes_straight(surface.layers, lobes)) {
        return -wo;
    }
    return cos_t_squared > 0.0 ? normalize(spread * facet.normal - eta * wo) : vec3(0.0);
}
