// What the base reflects by its facets: a mirror where it is smooth.

#include "material/layering.glsl"

Facets base_facets(Surface surface)
{
    Layers layers = surface.layers;
    return Facets(surface.ns, layers.alpha, layers.is_stretched, layers.alpha_along, layers.tangent);
}

// `eta`: index where wo is over that beyond, of a solid.
Base base_of(Surface surface, float eta)
{
    Layers layers = surface.layers;
    float dielectric = 1.0 - layers.metallic;
    float along = divide(layers.ior - 1.0, layers.ior + 1.0);
    vec3 f0 = min(along * along * layers.specular_colour, vec3(1.0)) * layers.specular;
    float f90 = layers.specular;

    Base base;
    base.opaque_share = dielectric * (1.0 - layers.transmission);
    base.dielectric_f0 = f0;
    base.dielectric_f90 = f90;
    base.eta = 1.0;
    base.exact_share = 0.0;
    base.exact_f0 = f0;
    base.exact_f90 = f90;
    float schlick_share = dielectric;
    if (HAS_TRANSMISSION && layers.is_solid && layers.transmission > 0.0) {
        base.eta = eta;
        float relative = divide(1.0 - eta, 1.0 + eta);
        base.exact_f0 = min(relative * relative * layers.specular_colour, vec3(1.0)) * layers.specular;
        base.exact_share = dielectric * layers.transmission;
        schlick_share = base.opaque_share;
    }
    base.f0 = layers.metallic * surface.base_colour + schlick_share * f0;
    base.f90 = layers.metallic + schlick_share * f90;
    base.film = no_film();
    if (HAS_IRIDESCENCE) {
        base.film = RoughFilm(layers.iridescence, layers.film_ior, layers.film_thickness, schlick_share, f0, layers.metallic,
                             surface.base_colour, 0);
    }
    return base;
}

// Rays follow what a solid reflects however rough it is: what it transmits they follow too. And they follow what is sharp across a
// tangent if not along it.
bool is_rough_reflection(Lobes lobes, Layers layers)
{
    bool is_stretched = false;
    if (HAS_ANISOTROPY) {
        is_stretched = layers.is_stretched;
    }
    return is_rough(layers.alpha) && lobes.base.exact_share == 0.0 && !is_stretched;
}

bool is_smooth_reflection(Layers layers, Lobes lobes)
{
    return lobes.reflection_chance > 0.0 && layers.alpha < DELTA_ALPHA;
}

// What a dielectric reflects that transmits. Of a solid: between F0 and F90 as exact reflectance is between its value along the normal
// and 1.
vec3 dielectric_reflectance(Base base, bool is_solid, float cosine)
{
    float share = fifth_power(clamp(1.0 - cosine, 0.0, 1.0));
    if (is_solid) {
        if (refracted_cosine_squared(cosine, base.eta) <= 0.0) {
            return vec3(1.0);
        }
        float along = divide(1.0 - base.eta, 1.0 + base.eta);
        along *= along;
        share = clamp(divide(reflectance_at(cosine, base.eta) - along, 1.0 - along), 0.0, 1.0);
    }
    vec3 exact = base.exact_f0 + (base.exact_f90 - base.exact_f0) * share;
    if (HAS_IRIDESCENCE && base.film.share > 0.0) {
        // The same from both sides: it is asked where the ray is in the rarer medium.
        float outside = is_solid && base.eta > 1.0 ? sqrt(max(refracted_cosine_squared(cosine, base.eta), 0.0)) : cosine;
        vec3 film = film_reflectance(base.exact_f0, base.film.ior, base.film.thickness, outside);
        exact = (1.0 - base.film.share) * exact + base.film.share * film;
    }
    return exact;
}

// At v.h; `exact` is the reflectance of what transmits, where some does.
vec3 reflection_colour(Base base, vec3 exact, float cosine)
{
    vec3 colour = base.f0 + (base.f90 - base.f0) * fifth_power(clamp(1.0 - cosine, 0.0, 1.0));
    if (HAS_IRIDESCENCE && base.film.share > 0.0) {
        colour = under_film(colour, base.film, cosine);
    }
    return colour + base.exact_share * exact;
}

// Share of light from wo that is reflected, as far as coat and sheen leave it.
float reflection_weight(Base base, Layers layers, LayerAlbedos seen, vec3 exact, float cosine)
{
    vec3 reflected = base.f0 * seen.base.x + base.f90 * seen.base.y;
    if (HAS_IRIDESCENCE && layers.iridescence > 0.0) {
        // Elsewhere the film may reflect what it does not here.
        vec3 film = max(under_film(vec3(0.0), base.film, cosine),
                        vec3(0.02 * layers.iridescence * (layers.metallic + base.film.dielectric)));
        reflected = (1.0 - layers.iridescence) * reflected + (seen.base.x + seen.base.y) * film;
    }
    return largest(reflected + base.exact_share * exact);
}

// The BRDF of what photon maps know of it, 1/sr.
vec3 reflection_brdf(RoughLobes lobes, RoughCover cover, RoughFilm film, LayerAlbedos towards_light, vec3 n, vec3 wo, vec3 wi)
{
    if (HAS_IRIDESCENCE && film.share > 0.0) {
        if (film.is_rough == 0) {
            return vec3(0.0);
        }
        float along = dot(wo, normalize(wo + wi));
        vec3 colour = lobes.f0 + (lobes.f90 - lobes.f0) * fifth_power(clamp(1.0 - along, 0.0, 1.0));
        return ggx_lobe(lobes.alpha, vec3(1.0), 1.0, wo, wi, n).x * under_film(colour, film, along) * below_cover(cover, towards_light);
    }
    if (lobes.f90 > 0.0 || largest(lobes.f0) > 0.0) {
        return ggx_lobe(lobes.alpha, lobes.f0, lobes.f90, wo, wi, n) * below_cover(cover, towards_light);
    }
    return vec3(0.0);
}

float reflection_density(Surface surface, Lobes lobes, vec3 wo, vec3 wi)
{
    return lobes.reflection_chance * weigh_reflection(base_facets(surface), wo, wi).density;
}
