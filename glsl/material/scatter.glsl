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

// Samples where a path goes on that came from wo; u = (choice, two for the direction). A camera path
// carries radiance, which refraction compresses; a photon carries flux. Glass that reflects some light and refracts some
// does the first with the chance `mirror_chance`; 0: as much as it reflects. The path has met `depth` surfaces before.
Scatter sample_scatter(Surface surface, vec3 wo, vec3 u, uint depth, bool carries_radiance, float mirror_chance)
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
            float eta = surface.front ? divide(1.0, surface.parameter) : surface.parameter;
            float cos_i = min(dot(wo, ns), 1.0);
            float cos_t_squared = refracted_cosine_squared(cos_i, eta);
            if (HAS_SMOOTH_NORMALS) {
                // Smooth normals do not keep phase space: without an end, some of what enters a coarse sphere is reflected in it
                // for ever. What enters a solid by its triangles alone also leaves it.
                if (cos_t_squared <= 0.0 && depth >= SMOOTH_TOTAL_REFLECTIONS) {
                    ns = surface.ng;
                    cos_i = min(dot(wo, ns), 1.0);
                    cos_t_squared = refracted_cosine_squared(cos_i, eta);
                }
            }
            float cos_t = sqrt(max(cos_t_squared, 0.0));
            float reflectance = cos_t_squared > 0.0 ? fresnel(cos_i, cos_t, eta) : 1.0;
            bool as_much = mirror_chance == 0.0 || reflectance == 0.0 || reflectance == 1.0;
            float chance = as_much ? reflectance : mirror_chance;
            if (u.x < chance) {
                vec3 wi = on_side(mirrored(wo, ns), surface.ng);
                float weight = as_much ? 1.0 : divide(reflectance, chance);
                return Scatter(wi, weight * surface.base_colour, dot(wi, surface.ng) > 0.0, true, false, 0.0);
            }
            vec3 wi = on_side(normalize((eta * cos_i - cos_t) * ns - eta * wo), -surface.ng);
            float weight = as_much ? 1.0 : divide(1.0 - reflectance, 1.0 - chance);
            weight *= carries_radiance ? eta * eta : 1.0;
            return Scatter(wi, weight * surface.base_colour, dot(wi, surface.ng) < 0.0, true, false, 0.0);
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
