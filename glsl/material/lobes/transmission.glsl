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

// At v.h.
vec3 transmission_colour(Lobes lobes, bool is_solid, float cosine)
{
    return lobes.transmitted * (1.0 - dielectric_reflectance(lobes.base, is_solid, cosine));
}

// Share of light from wo that is transmitted, as far as coat and sheen leave it, whose reflectance is `exact`.
vec3 transmission_along(Lobes lobes, Layers layers, vec3 exact)
{
    if (HAS_TRANSMISSION && layers.transmission > 0.0) {
        vec3 transmitted = lobes.transmitted * (1.0 - exact);
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

// BTDF times cosine where it is no delta, beside which a light sample of this density counts in part.
vec3 sharp_transmission(Surface surface, Lobes lobes, LayerAlbedos lit, vec3 wo, vec3 wi, float light_density)
{
    Layers layers = surface.layers;
    if (layers.alpha < DELTA_ALPHA || lobes.transmission_chance <= 0.0) {
        return vec3(0.0);
    }
    Weighed found;
    if (layers.is_solid) {
        found = weigh_refraction(base_facets(surface), lobes.base.eta, wo, wi);
    } else {
        // A thin wall transmits as it would reflect the mirrored direction.
        found = weigh_reflection(base_facets(surface), wo, wi - 2.0 * dot(wi, surface.ns) * surface.ns);
    }
    if (found.density <= 0.0) {
        return vec3(0.0);
    }
    vec3 colour = transmission_colour(lobes, layers.is_solid, found.along) * below_cover(lobes.cover, lit);
    return colour * (found.value * light_share(light_density, lobes.transmission_chance * found.density));
}

Scatter sample_transmission(Surface surface, Lobes lobes, Facets facets, SampledFacet facet, vec3 wo, float chance, bool carries_radiance)
{
    Layers layers = surface.layers;
    float eta = lobes.base.eta;
    vec3 wi = 2.0 * facet.along * facet.normal - wo;
    bool is_total = false;
    if (layers.is_solid) {
        float cos_t_squared = refracted_cosine_squared(facet.along, eta);
        float l_h = sqrt(max(cos_t_squared, 0.0));
        float spread = eta * facet.along - l_h;
        is_total = cos_t_squared <= 0.0;
        wi = normalize(spread * facet.normal - eta * wo);
        facet.density *= facet.along * divide(l_h, max(spread * spread, 1e-12));
    } else {
        wi = wi - 2.0 * dot(wi, facets.n) * facets.n;
        facet.density *= 0.25;
    }
    Scatter scatter = leave_facet(facets, facet, wo, wi, -dot(wi, facets.n), -surface.ng, chance);
    if (goes_straight(layers, lobes)) {
        scatter.direction = -wo;
        scatter.alive = true;
    }
    scatter.alive = scatter.alive && !is_total;
    if (carries_radiance && layers.is_solid) {
        scatter.weight *= eta * eta;
    }
    LayerAlbedos lit = albedos_towards(surface, lobes.cover, scatter.direction);
    scatter.weight *= transmission_colour(lobes, layers.is_solid, facet.along) * below_cover(lobes.cover, lit);
    return scatter;
}
