// Where paths go on from a surface.

struct Scatter {
    vec3 direction;
    vec3 weight; // f * cosine / pdf
    bool alive;
    bool is_specular; // by a lobe that rays follow; photon maps know the others
    bool passes; // straight, as if no surface were there
    float density; // of the direction, 1/sr; 0: that of a delta, of the diffuse lobe or of sheen
};

// Fresnel reflectance of unpolarised light; eta = n_i / n_t.
float fresnel(float cos_i, float cos_t, float eta)
{
    float parallel = divide(cos_i - eta * cos_t, cos_i + eta * cos_t);
    float perpendicular = divide(eta * cos_i - cos_t, eta * cos_i + cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// Square of the refracted ray's cosine, exact where the index is 1; 0 or less in total internal reflection.
float refracted_cosine_squared(float cos_i, float eta)
{
    return eta * eta * cos_i * cos_i + (1.0 - eta) * (1.0 + eta);
}

// A direction on the side that a unit vector points to. A shading normal may send a mirrored or refracted ray to the wrong side
// of its triangle; mirrored in the triangle's plane, as if it met the surface once more, it leaves with all of its light.
vec3 on_side(vec3 direction, vec3 side)
{
    return direction - 2.0 * min(dot(direction, side), 0.0) * side;
}

#include "material/layered_lobes.glsl"
#include "material/layered_sampling.glsl"

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
    if (HAS_SMOOTH_NORMALS) {
        // Smooth normals do not keep phase space: without an end, some of what enters a coarse sphere is reflected in it
        // for ever. What enters a solid by its triangles alone also leaves it.
        if (cos_t_squared <= 0.0 && depth >= SMOOTH_TOTAL_REFLECTIONS) {
            normal = surface.ng;
            cos_i = min(dot(wo, normal), 1.0);
            cos_t_squared = refracted_cosine_squared(cos_i, eta);
        }
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

// Samples where a path goes on that came from wo; u = (choice, two for the direction). A camera path
// carries radiance, which refraction compresses; a photon carries flux. The path has met `depth` surfaces before.
Scatter sample_scatter(Surface surface, vec3 wo, vec3 u, uint depth, bool carries_radiance)
{
    vec3 ns = surface.ns;
    if (HAS_MIRROR) {
        if (surface.kind == SURFACE_MIRROR) {
            vec3 wi = on_side(mirrored(wo, ns), surface.ng);
            return Scatter(wi, surface.base_colour, dot(wi, surface.ng) > 0.0, true, false, 0.0);
        }
    }
    if (HAS_DIELECTRIC) {
        if (surface.kind == SURFACE_DIELECTRIC) {
            Glass glass = glass_at(surface, wo, depth);
            return way_of_glass(surface, glass, wo, u.x < glass.reflectance, carries_radiance);
        }
    }
    if (HAS_GLOSSY) {
        if (surface.kind == SURFACE_GLOSSY) {
            float n = surface.parameter;
            vec3 wi = to_frame(sample_lobe(n, u.y, u.z), mirrored(wo, ns));
            float cos_out = dot(wi, ns);
            vec3 weight = surface.base_colour * (divide(n + 2.0, n + 1.0) * max(cos_out, 0.0));
            return Scatter(wi, weight, cos_out > 0.0 && dot(wi, surface.ng) > 0.0, false, false, 0.0);
        }
    }
    vec3 wi = to_frame(sample_cosine_hemisphere(u.y, u.z), ns);
    return Scatter(wi, surface.base_colour, dot(wi, surface.ng) > 0.0, false, false, 0.0);
}
