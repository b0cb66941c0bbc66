// Light that enters as that of the diffuse lobe does, and is scattered evenly to the other side.

#include "material/lobes/diffuse.glsl"

vec3 diffuse_transmission_colour(Layers layers, Base base)
{
    return base.opaque_share * layers.diffuse_transmission * layers.diffuse_transmission_colour;
}

// As the weight of the diffuse lobe.
float diffuse_transmission_weight(Layers layers, Base base, float below)
{
    return base.opaque_share * layers.diffuse_transmission * largest(layers.diffuse_transmission_colour) * below;
}

// Under coat and sheen, 1/sr.
vec3 diffuse_transmission_btdf(Lobes lobes, LayerAlbedos towards_light)
{
    return below_all(lobes.beyond, lobes.rough, lobes.cover, towards_light);
}

// BTDF times cosine, beside which a light sample of this density counts in part.
vec3 sharp_diffuse_transmission(Surface surface, Lobes lobes, LayerAlbedos towards_light, vec3 wi, float light_density)
{
    float cosine = dot(wi, surface.ns);
    if (cosine < 0.0 && lobes.beyond_chance > 0.0) {
        float density = lobes.beyond_chance * even_density(-surface.ns, wi);
        return diffuse_transmission_btdf(lobes, towards_light) * (-cosine * light_share(light_density, density));
    }
    return vec3(0.0);
}
