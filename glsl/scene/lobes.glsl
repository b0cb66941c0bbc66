// How surfaces weigh light that arrives.

// max(cosine, 0)^exponent, 1 for exponent 0.
float lobe(float cosine, float exponent)
{
    return cosine <= 0.0 ? 0.0 : (exponent == 0.0 ? 1.0 : exp2(exponent * log2(min(cosine, 1.0))));
}

vec3 mirrored(vec3 w, vec3 n)
{
    return 2.0 * dot(w, n) * n - w;
}

// The factor in front of a surface's lobe: f = scale * lobe_weight.
float scatter_scale(uint kind, float exponent)
{
    return kind == SURFACE_GLOSSY ? (exponent + 2.0) * 0.15915494309189535 : 0.31830988618379067;
}

// How a lobe weighs light from wi towards wo; 1 on a Lambertian surface.
float lobe_weight(uint kind, float exponent, vec3 ns, vec3 wo, vec3 wi)
{
    bool has_lobe = false;
    if (HAS_GLOSSY) {
        has_lobe = has_lobe || kind == SURFACE_GLOSSY;
    }
    if (HAS_PAPER_PHONG) {
        has_lobe = has_lobe || kind == SURFACE_PAPER_PHONG;
    }
    return has_lobe ? lobe(dot(mirrored(wi, ns), wo), exponent) : 1.0;
}

// What a shading normal changes about a photon's flux (Veach 1997, section 5.3): the ratio of the cosines
// that the light sees to those that the eye sees.
float shading_gain(float shading_cosine, float geometric_cosine)
{
    return min(divide(abs(shading_cosine), max(abs(geometric_cosine), 1e-6)), float(MAX_SHADING_GAIN));
}
