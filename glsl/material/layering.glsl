// Lobes over one another: what a layered surface has of each, and what the upper ones leave to the lower ones. The guide's page on
// materials has the formulas.

#include "math/directions.glsl"
#include "material/layers.glsl"
#include "material/albedo.glsl"
#include "material/scatter.glsl"
#include "material/film.glsl"

// How the rough lobes of a layered visible point weigh light (glsl/material/rough_brdf.glsl). Those that are none have weight 0.
struct RoughLobes {
    // All of the diffuse lobe but the factors of where light comes from.
    vec3 diffuse;
    // What the dielectric reflects along its normal and at the horizon, in the largest channel.
    float e0;
    float e90;
    // Of the base's reflection.
    float alpha;
    vec3 f0;
    float f90;
};

// What lies over them.
struct RoughCover {
    float coat;
    float coat_alpha;
    // It is no sharp lobe.
    uint has_coat_lobe;
    uint coat_normal;
    // What the coat reflects of all light towards the eye, and what white sheen would.
    float coat_albedo;
    float sheen_albedo;
    vec3 sheen;
    float sheen_alpha;
    // Under them; here for it to be stored (drivers allow few buffers).
    RoughFilm film;
};

// What the base reflects: metal and dielectric, mixed, under a film.
struct Base {
    // (1 - m) (1 - t)
    float opaque_share;
    // Of the dielectric, and of all that Schlick's formula describes.
    vec3 dielectric_f0;
    float dielectric_f90;
    vec3 f0;
    float f90;
    // Of a solid that refracts: 1 - m times t, F0 and F90 of exact Fresnel reflectance.
    vec3 exact_f0;
    float exact_f90;
    float exact_share;
    // Index of refraction where the eye is, over that beyond; 1 for a thin wall.
    float eta;
    RoughFilm film;
};

// The lobes of a layered surface as they are seen from a direction. Each has a file in material/lobes.
struct Lobes {
    Base base;
    RoughLobes rough;
    RoughCover cover;
    // (1 - m) t b
    vec3 transmitted;
    // All of diffuse transmission but the factors of where light comes from.
    vec3 beyond;
    // Light that goes straight on, and the probability with which a path does.
    vec3 passing;
    float pass_chance;
    // Probabilities of the others where it does not.
    float diffuse_chance;
    float sheen_chance;
    float reflection_chance;
    float coat_chance;
    float transmission_chance;
    float beyond_chance;
};

RoughCover no_cover()
{
    return RoughCover(0.0, 1.0, 0, 0, 0.0, 0.0, vec3(0.0), 1.0, no_film());
}

bool is_rough(float alpha)
{
    return alpha >= MAP_ALPHA;
}

// Coat and sheen of a surface, before it is known what they reflect towards the eye.
RoughCover cover_of(Layers layers)
{
    RoughCover cover = no_cover();
    if (HAS_COATS) {
        cover.coat = layers.coat;
        cover.coat_alpha = layers.coat_alpha;
        cover.has_coat_lobe = uint(layers.coat > 0.0 && is_rough(layers.coat_alpha));
        cover.coat_normal = pack_normal(layers.coat_normal);
    }
    if (HAS_SHEEN) {
        cover.sheen = layers.sheen;
        cover.sheen_alpha = layers.sheen_alpha;
    }
    return cover;
}

// What layers reflect of all light from a direction, by its cosines to the normals of base and coat.
struct LayerAlbedos {
    vec2 base; // factors of F0 and F90
    float coat;
    float sheen; // of white sheen
};

// The coat reflects by its own normal, and takes from what lies below it as much as it reflects: else light is gained.
LayerAlbedos albedos_at(float alpha, RoughCover cover, float cosine, float coat_cosine)
{
    LayerAlbedos albedos = LayerAlbedos(ggx_albedo(alpha, cosine), 0.0, 0.0);
    if (HAS_COATS && cover.coat > 0.0) {
        vec2 of_coat = ggx_albedo(cover.coat_alpha, coat_cosine);
        albedos.coat = cover.coat * (0.04 * of_coat.x + of_coat.y);
    }
    if (HAS_SHEEN && cover.sheen != vec3(0.0)) {
        albedos.sheen = sheen_albedo(cover.sheen_alpha, cosine);
    }
    return albedos;
}

// What layers reflect of all light from wi, on either side.
LayerAlbedos albedos_towards(Surface surface, RoughCover cover, vec3 wi)
{
    return albedos_at(surface.layers.alpha, cover, abs(dot(wi, surface.ns)), abs(dot(wi, surface.layers.coat_normal)));
}

// What sheen leaves to what is under it.
float below_sheen(vec3 sheen, float albedo)
{
    return 1.0 - largest(sheen) * min(albedo, 1.0);
}

// What reflection leaves to the diffuse lobe, of e0 and e90.
float below_base(float e0, float e90, vec2 albedo)
{
    return max(1.0 - (e0 * albedo.x + e90 * albedo.y), 0.0);
}

// What coat and sheen leave, seen along one direction and lit along another.
float below_cover(RoughCover cover, LayerAlbedos towards_light)
{
    float below = 1.0;
    if (HAS_COATS) {
        below = 1.0 - max(cover.coat_albedo, towards_light.coat);
    }
    if (HAS_SHEEN) {
        below *= below_sheen(cover.sheen, max(cover.sheen_albedo, towards_light.sheen));
    }
    return below;
}

// A diffuse lobe below the base's reflection, coat and sheen.
vec3 below_all(vec3 diffuse, RoughLobes lobes, RoughCover cover, LayerAlbedos towards_light)
{
    diffuse *= below_base(lobes.e0, lobes.e90, towards_light.base);
    if (HAS_COATS) {
        diffuse *= 1.0 - towards_light.coat;
    }
    if (HAS_SHEEN) {
        diffuse *= below_sheen(cover.sheen, max(cover.sheen_albedo, towards_light.sheen));
    }
    return diffuse;
}
