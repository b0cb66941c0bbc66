// Lobes that photon maps know, as they weigh light: diffuse, sheen, and what GGX reflects broadly. Expects material/albedo.glsl,
// material/ggx.glsl and material/layers.glsl.

// How the matt lobes of a layered visible point weigh light (glsl/material/matt_lobes.glsl). Those that are none have weight 0.
struct MattLobes {
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

// A thin film on the base: how much of it is there, and shares of dielectric and metal in what is reflected below it, with their F0.
struct MattFilm {
    float share;
    float ior;
    float thickness;
    float dielectric;
    vec3 f0;
    float metal;
    vec3 metal_f0;
    // What it reflects is no sharp lobe.
    uint is_matt;
};

// What lies over them.
struct MattCover {
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
    MattFilm film;
};

// Masking and density of sheen (Estevez and Kulla 2017).
float sheen_fit(vec3 factors, vec2 line, float x)
{
    float power = x > 0.0 ? exp2(factors.z * log2(x)) : 0.0;
    return divide(factors.x, 1.0 + factors.y * power) + line.x * x + line.y;
}

float sheen_lambda(float alpha, float cosine)
{
    float share = 1.0 - (1.0 - alpha) * (1.0 - alpha);
    vec3 factors = vec3(25.3245, 3.32435, 0.16801) + share * (vec3(21.5473, 3.82987, 0.19823) - vec3(25.3245, 3.32435, 0.16801));
    vec2 line = vec2(-1.27393, -4.85967) + share * (vec2(-1.97760, -4.32054) - vec2(-1.27393, -4.85967));
    float logarithm = cosine < 0.5 ? sheen_fit(factors, line, cosine)
                                   : 2.0 * sheen_fit(factors, line, 0.5) - sheen_fit(factors, line, 1.0 - cosine);
    return exp2(1.44269504088896341 * logarithm);
}

// D V of sheen; `albedos` are its own, towards both directions.
float sheen_lobe(float alpha, vec3 wo, vec3 wi, vec3 n, vec2 albedos)
{
    float cos_l = dot(wi, n), cos_v = dot(wo, n);
    if (cos_l <= 0.0 || cos_v <= 0.0) {
        return 0.0;
    }
    vec3 h = to_local(normalize(wo + wi), n);
    float sine_squared = h.x * h.x + h.y * h.y;
    float power = sine_squared > 0.0 ? exp2(divide(0.5, alpha) * log2(sine_squared)) : 0.0;
    float density = (2.0 + divide(1.0, alpha)) * power * 0.15915494309189535;
    // Where fitted masking would return more than it receives.
    float excess = max(1.0, max(albedos.x, albedos.y));
    return divide(density, (1.0 + sheen_lambda(alpha, cos_v) + sheen_lambda(alpha, cos_l)) * 4.0 * cos_l * cos_v * excess);
}

// D V (F0 + (F90 - F0) (1 - v.h)^5); 0 from behind.
vec3 ggx_lobe(float alpha, vec3 f0, float f90, vec3 wo, vec3 wi, vec3 n)
{
    float cos_l = dot(wi, n), cos_v = dot(wo, n);
    if (cos_l <= 0.0 || cos_v <= 0.0) {
        return vec3(0.0);
    }
    vec3 h = normalize(wo + wi);
    float grazing = fifth_power(clamp(1.0 - dot(wo, h), 0.0, 1.0));
    return ggx_density(to_local(h, n), alpha) * ggx_visibility(alpha, cos_l, cos_v) * (f0 + (f90 - f0) * grazing);
}

#include "material/film.glsl"

MattFilm no_film()
{
    return MattFilm(0.0, 1.0, 0.0, 0.0, vec3(0.0), 0.0, vec3(0.0), 0);
}

MattCover no_cover()
{
    return MattCover(0.0, 1.0, 0, 0, 0.0, 0.0, vec3(0.0), 1.0, no_film());
}

// What layers reflect of all light from a direction, by its cosines to the normals of base and coat.
struct LayerAlbedos {
    vec2 base; // factors of F0 and F90
    float coat;
    float sheen; // of white sheen
};

// The coat reflects by its own normal, and takes from what lies below it as much as it reflects: else light is gained.
LayerAlbedos albedos_at(float alpha, MattCover cover, float cosine, float coat_cosine)
{
    LayerAlbedos albedos = LayerAlbedos(ggx_albedo(alpha, cosine), 0.0, 0.0);
    if (HAS_COATS) {
        if (cover.coat > 0.0) {
            vec2 of_coat = ggx_albedo(cover.coat_alpha, coat_cosine);
            albedos.coat = cover.coat * (0.04 * of_coat.x + of_coat.y);
        }
    }
    if (HAS_SHEEN) {
        if (cover.sheen != vec3(0.0)) {
            albedos.sheen = sheen_albedo(cover.sheen_alpha, cosine);
        }
    }
    return albedos;
}

float largest(vec3 v)
{
    return max(v.x, max(v.y, v.z));
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
float below_cover(MattCover cover, LayerAlbedos lit)
{
    float below = 1.0;
    if (HAS_COATS) {
        below = 1.0 - max(cover.coat_albedo, lit.coat);
    }
    if (HAS_SHEEN) {
        below *= below_sheen(cover.sheen, max(cover.sheen_albedo, lit.sheen));
    }
    return below;
}

// A diffuse lobe below the base's reflection, coat and sheen.
vec3 below_all(vec3 diffuse, MattLobes lobes, MattCover cover, LayerAlbedos lit)
{
    diffuse *= below_base(lobes.e0, lobes.e90, lit.base);
    if (HAS_COATS) {
        diffuse *= 1.0 - lit.coat;
    }
    if (HAS_SHEEN) {
        diffuse *= below_sheen(cover.sheen, max(cover.sheen_albedo, lit.sheen));
    }
    return diffuse;
}

// The diffuse lobe under coat and sheen, 1/sr.
vec3 diffuse_brdf(MattLobes lobes, MattCover cover, LayerAlbedos lit)
{
    return below_all(lobes.diffuse, lobes, cover, lit);
}

// Sheen under a coat, 1/sr.
vec3 sheen_brdf(MattCover cover, LayerAlbedos lit, vec3 n, vec3 wo, vec3 wi)
{
    vec3 sheen = vec3(0.0);
    if (HAS_SHEEN) {
        if (cover.sheen != vec3(0.0)) {
            sheen = cover.sheen * sheen_lobe(cover.sheen_alpha, wo, wi, n, vec2(cover.sheen_albedo, lit.sheen));
            if (HAS_COATS) {
                sheen *= 1.0 - max(cover.coat_albedo, lit.coat);
            }
        }
    }
    return sheen;
}

// The BRDF of all matt lobes together, 1/sr, from above the surface; `lit` are the albedos towards wi.
vec3 matt_brdf(MattLobes lobes, MattCover cover, MattFilm film, LayerAlbedos lit, vec3 n, vec3 wo, vec3 wi)
{
    vec3 sum = diffuse_brdf(lobes, cover, lit) + sheen_brdf(cover, lit, n, wo, wi);
    bool is_bare = true;
    if (HAS_IRIDESCENCE) {
        if (film.share > 0.0) {
            is_bare = false;
            if (film.is_matt != 0) {
                float along = dot(wo, normalize(wo + wi));
                vec3 colour = lobes.f0 + (lobes.f90 - lobes.f0) * fifth_power(clamp(1.0 - along, 0.0, 1.0));
                sum += ggx_lobe(lobes.alpha, vec3(1.0), 1.0, wo, wi, n).x * under_film(colour, film, along) * below_cover(cover, lit);
            }
        }
    }
    if (is_bare && (lobes.f90 > 0.0 || largest(lobes.f0) > 0.0)) {
        sum += ggx_lobe(lobes.alpha, lobes.f0, lobes.f90, wo, wi, n) * below_cover(cover, lit);
    }
    if (HAS_COATS) {
        if (cover.has_coat_lobe != 0) {
            vec3 coat_normal = unpack_normal(cover.coat_normal);
            // BRDFs are weighed with the cosine to n, and the coat's lobe has its own.
            sum += cover.coat * ggx_lobe(cover.coat_alpha, vec3(0.04), 1.0, wo, wi, coat_normal)
                 * divide(max(dot(wi, coat_normal), 0.0), max(dot(wi, n), 1e-6));
        }
    }
    return sum;
}
