// The diffuse lobe: light enters below coat, sheen and reflection, and is scattered back evenly.

#include "material/layering.glsl"

// Bound of what stretched facets reflect beyond even ones as sharp as they are across, at a cosine, by a reflectance that is 1 at the horizon.
float stretch_excess(float cosine)
{
    return 0.004 + 0.1 * max(1.0 - 4.5 * cosine, 0.0);
}

// F0 and F90 of a bound of what the dielectric reflects.
vec2 reflectance_bound(Base base, Layers layers)
{
    float e0 = largest(base.dielectric_f0), e90 = base.dielectric_f90;
    if (HAS_IRIDESCENCE) {
        e0 += layers.iridescence * (layers.film_bound - e0);
        e90 += layers.iridescence * (1.0 - e90);
    }
    return vec2(e0, e90);
}

// Share of light from wo that gets below coat and reflection.
float share_below(Layers layers, RoughLobes rough, LayerAlbedos seen, float cosine)
{
    float below = below_base(rough.e0, rough.e90, seen.base);
    if (HAS_ANISOTROPY && layers.is_stretched) {
        below = max(below - rough.e90 * stretch_excess(cosine), 0.0);
    }
    return below * (1.0 - seen.coat);
}

// The mean of that share over all directions.
float mean_share_below(Layers layers, RoughLobes rough)
{
    vec2 mean = mean_albedo(layers.alpha);
    float left = 1.0 - (rough.e0 * mean.x + rough.e90 * mean.y);
    if (HAS_COATS && layers.coat > 0.0) {
        vec2 coat_mean = mean_albedo(layers.coat_alpha);
        vec2 first = mean_products(layers.alpha, layers.coat_alpha, false);
        vec2 second = mean_products(layers.alpha, layers.coat_alpha, true);
        left += layers.coat * (rough.e0 * (0.04 * first.x + first.y) + rough.e90 * (0.04 * second.x + second.y) - (0.04 * coat_mean.x + coat_mean.y));
    }
    return left;
}

vec3 diffuse_colour(Surface surface, Base base)
{
    vec3 colour = surface.base_colour;
    if (HAS_DIFFUSE_TRANSMISSION) {
        colour *= 1.0 - surface.layers.diffuse_transmission;
    }
    return base.opaque_share * colour;
}

// Share of light that it takes, of what gets below coat and reflection.
float diffuse_weight(Surface surface, Base base, float below)
{
    return largest(diffuse_colour(surface, base)) * below;
}

// The diffuse lobe under coat and sheen, 1/sr.
vec3 diffuse_brdf(RoughLobes lobes, RoughCover cover, LayerAlbedos towards_light)
{
    return below_all(lobes.diffuse, lobes, cover, towards_light);
}

// Of what is scattered about n as by the cosine.
float even_density(vec3 n, vec3 wi)
{
    return 0.31830988618379067 * max(dot(wi, n), 0.0);
}
