// Lobes that photon maps know, as they weigh light: diffuse, sheen, and what GGX reflects broadly. Expects material/albedo.glsl,
// material/ggx.glsl and material/layers.glsl.

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

// D V of sheen.
float sheen_lobe(float alpha, vec3 wo, vec3 wi, vec3 n)
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
    float excess = max(1.0, max(sheen_albedo(alpha, cos_v), sheen_albedo(alpha, cos_l)));
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

// What a coat, or sheen, reflects of all light from a direction.
float coat_albedo(float coat, float alpha, float cosine)
{
    vec2 albedo = ggx_albedo(alpha, cosine);
    return coat * (0.04 * albedo.x + albedo.y);
}

float sheen_share(vec3 sheen, float alpha, float cosine)
{
    return max(sheen.x, max(sheen.y, sheen.z)) * min(sheen_albedo(alpha, cosine), 1.0);
}

MattCover no_cover()
{
    return MattCover(0.0, 1.0, 0, 0, 1.0, 1.0, vec3(0.0), 1.0);
}

// The diffuse lobe under coat and sheen, 1/sr.
vec3 diffuse_brdf(MattLobes lobes, MattCover cover, vec3 n, vec3 wi)
{
    float cosine = dot(wi, n);
    if (cosine <= 0.0) {
        return vec3(0.0);
    }
    vec2 albedo = ggx_albedo(lobes.alpha, cosine);
    vec3 diffuse = lobes.diffuse * max(1.0 - (lobes.e0 * albedo.x + lobes.e90 * albedo.y), 0.0);
    if (HAS_COATS) {
        diffuse *= cover.coat > 0.0 ? 1.0 - coat_albedo(cover.coat, cover.coat_alpha, cosine) : 1.0;
    }
    if (HAS_SHEEN) {
        diffuse *= cover.sheen != vec3(0.0) ? min(cover.below_sheen, 1.0 - sheen_share(cover.sheen, cover.sheen_alpha, cosine)) : 1.0;
    }
    return diffuse;
}

// The BRDF of all matt lobes together, 1/sr.
vec3 matt_brdf(MattLobes lobes, MattCover cover, vec3 n, vec3 wo, vec3 wi)
{
    float cosine = dot(wi, n);
    if (cosine <= 0.0) {
        return vec3(0.0);
    }
    vec3 diffuse = diffuse_brdf(lobes, cover, n, wi);
    vec3 reflected = vec3(0.0);
    if (lobes.f90 > 0.0 || max(lobes.f0.x, max(lobes.f0.y, lobes.f0.z)) > 0.0) {
        reflected = ggx_lobe(lobes.alpha, lobes.f0, lobes.f90, wo, wi, n);
    }
    vec3 over = vec3(0.0);
    float below_coat = 1.0;
    if (HAS_COATS) {
        if (cover.coat > 0.0) {
            below_coat = min(cover.below_coat, 1.0 - coat_albedo(cover.coat, cover.coat_alpha, cosine));
            if (cover.has_coat_lobe != 0) {
                vec3 coat_normal = unpack_normal(cover.coat_normal);
                // BRDFs are weighed with the cosine to n, and the coat's lobe has its own.
                over = cover.coat * ggx_lobe(cover.coat_alpha, vec3(0.04), 1.0, wo, wi, coat_normal) * divide(max(dot(wi, coat_normal), 0.0), cosine);
            }
        }
    }
    reflected *= below_coat;
    if (HAS_SHEEN) {
        if (cover.sheen != vec3(0.0)) {
            reflected *= min(cover.below_sheen, 1.0 - sheen_share(cover.sheen, cover.sheen_alpha, cosine));
            reflected += below_coat * cover.sheen * sheen_lobe(cover.sheen_alpha, wo, wi, n);
        }
    }
    return diffuse + reflected + over;
}
