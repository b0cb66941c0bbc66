// A smooth solid that reflects and refracts.

#include "material/layers.glsl"
#include "material/scatter.glsl"

// What smooth glass does with light that came from wo.
struct Glass {
    vec3 normal;
    float eta; // index where wo is over that beyond
    float cos_i;
    float cos_t;
    float reflectance;
};

// The path has met `depth` surfaces before.
Glass glass_at(Surface surface, vec3 wo, uint depth)
{
    float eta = surface.front ? divide(1.0, surface.parameter) : surface.parameter;
    vec3 normal = surface.ns;
    float cos_i = min(dot(wo, normal), 1.0);
    float cos_t_squared = refracted_cosine_squared(cos_i, eta);
    // Smooth normals do not keep phase space: without an end, some of what enters a coarse sphere is reflected in it
    // for ever. What enters a solid by its triangles alone also leaves it.
    if (HAS_SMOOTH_NORMALS && cos_t_squared <= 0.0 && depth >= SMOOTH_TOTAL_REFLECTIONS) {
        normal = surface.ng;
        cos_i = min(dot(wo, normal), 1.0);
        cos_t_squared = refracted_cosine_squared(cos_i, eta);
    }
    float cos_t = sqrt(max(cos_t_squared, 0.0));
    return Glass(normal, eta, cos_i, cos_t, cos_t_squared > 0.0 ? fresnel(cos_i, cos_t, eta) : 1.0);
}

// Where light goes on that glass reflects or refracts, as if it did all of it.
Scatter way_of_glass(Surface surface, Glass glass, vec3 wo, bool reflects, bool carries_radiance)
{
    if (reflects) {
        vec3 wi = on_side(mirrored(wo, glass.normal), surface.ng);
        return Scatter(wi, surface.base_colour, dot(wi, surface.ng) > 0.0, true, false, 0.0);
    }
    vec3 wi = on_side(normalize((glass.eta * glass.cos_i - glass.cos_t) * glass.normal - glass.eta * wo), -surface.ng);
    float weight = carries_radiance ? glass.eta * glass.eta : 1.0;
    return Scatter(wi, weight * surface.base_colour, dot(wi, surface.ng) < 0.0, true, false, 0.0);
}

Scatter sample_glass(Surface surface, vec3 wo, float u, uint depth, bool carries_radiance)
{
    Glass glass = glass_at(surface, wo, depth);
    return way_of_glass(surface, glass, wo, u < glass.reflectance, carries_radiance);
}
