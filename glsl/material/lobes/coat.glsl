// A clear coat of index 1.5 over all else, with a normal of its own.

#include "material/layering.glsl"

Facets coat_facets(Surface surface)
{
    return even_facets(surface.layers.coat_normal, surface.layers.coat_alpha);
}

bool is_smooth_coat(Layers layers, Lobes lobes)
{
    return lobes.coat_chance > 0.0 && layers.coat_alpha < DELTA_ALPHA;
}

float coat_colour(float coat, float cosine)
{
    return coat * (0.04 + 0.96 * fifth_power(clamp(1.0 - cosine, 0.0, 1.0)));
}

// The BRDF of what photon maps know of it, 1/sr.
vec3 coat_brdf(RoughCover cover, vec3 n, vec3 wo, vec3 wi)
{
    if (HAS_COATS && cover.has_coat_lobe != 0) {
        vec3 coat_normal = unpack_normal(cover.coat_normal);
        // BRDFs are weighed with the cosine to n, and the coat's lobe has its own.
        return cover.coat * ggx_lobe(cover.coat_alpha, vec3(0.04), 1.0, wo, wi, coat_normal)
             * divide(max(dot(wi, coat_normal), 0.0), max(dot(wi, n), 1e-6));
    }
    return vec3(0.0);
}

float coat_density(Surface surface, Lobes lobes, vec3 wo, vec3 wi)
{
    return lobes.coat_chance * weigh_reflection(coat_facets(surface), wo, wi).density;
}

// BRDF times cosine of what rays follow that is no delta, beside which a light sample of this density counts in part. Its own cosine is that
// to its own normal.
vec3 sharp_coat(Surface surface, Lobes lobes, vec3 wo, vec3 wi, float light_density)
{
    Layers layers = surface.layers;
    if (layers.coat_alpha < DELTA_ALPHA || is_rough(layers.coat_alpha) || lobes.coat_chance <= 0.0) {
        return vec3(0.0);
    }
    Weighed found = weigh_reflection(coat_facets(surface), wo, wi);
    if (found.density <= 0.0) {
        return vec3(0.0);
    }
    float share = light_share(light_density, lobes.coat_chance * found.density);
    return vec3(coat_colour(layers.coat, found.along) * found.value * share);
}
