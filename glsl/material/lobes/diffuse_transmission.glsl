// Light that enters as that of the diffuse lobe does, and is scattered evenly to the other side.

#include "material/layering.glsl"

// BTDF times cosine, beside which a light sample of this density counts in part.
vec3 sharp_diffuse_transmission(Surface surface, Lobes lobes, LayerAlbedos lit, vec3 wi, float light_density)
{
    float cosine = dot(wi, surface.ns);
    if (HAS_DIFFUSE_TRANSMISSION && cosine < 0.0 && lobes.beyond_chance > 0.0) {
        float density = lobes.beyond_chance * (0.31830988618379067 * -cosine);
        return below_all(lobes.beyond, lobes.matt, lobes.cover, lit) * (-cosine * light_share(light_density, density));
    }
    return vec3(0.0);
}

Scatter sample_diffuse_transmission(Surface surface, Lobes lobes, vec2 u, float chance)
{
    vec3 wi = to_frame(sample_cosine_hemisphere(u.x, u.y), -surface.ns);
    float cosine = max(-dot(wi, surface.ns), 0.0);
    vec3 btdf = below_all(lobes.beyond, lobes.matt, lobes.cover, albedos_towards(surface, lobes.cover, wi));
    float density = chance * (0.31830988618379067 * cosine);
    return Scatter(wi, btdf * divide(3.14159265358979324, chance), dot(wi, surface.ng) < 0.0 && density > 0.0, true, false, density);
}
