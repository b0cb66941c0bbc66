// Sheen of fibres (Estevez and Kulla 2017), between the base and its coat.

#include "material/layering.glsl"

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

// Sheen under a coat, 1/sr.
vec3 sheen_brdf(RoughCover cover, LayerAlbedos towards_light, vec3 n, vec3 wo, vec3 wi)
{
    vec3 sheen = vec3(0.0);
    if (HAS_SHEEN && cover.sheen != vec3(0.0)) {
        sheen = cover.sheen * sheen_lobe(cover.sheen_alpha, wo, wi, n, vec2(cover.sheen_albedo, towards_light.sheen));
        if (HAS_COATS) {
            sheen *= 1.0 - max(cover.coat_albedo, towards_light.coat);
        }
    }
    return sheen;
}
