// GGX with correlated Smith masking (Heitz 2014), in frames whose z is the normal. Cosines are above 0.

#include "math/directions.glsl"
#include "rng/sampling.glsl"
#include "material/scatter.glsl"

// Microfacets about a normal. Stretched ones are rougher along a tangent than across it (Burley 2012, section 5.4).
struct Facets {
    vec3 n;
    float alpha;
    bool is_stretched;
    float alpha_along;
    vec3 tangent;
};

Facets even_facets(vec3 n, float alpha)
{
    return Facets(n, alpha, false, alpha, vec3(0.0));
}

vec3 to_local(vec3 w, vec3 n)
{
    vec3 tangent = to_frame(vec3(1.0, 0.0, 0.0), n), bitangent = to_frame(vec3(0.0, 1.0, 0.0), n);
    return vec3(dot(w, tangent), dot(w, bitangent), dot(w, n));
}

float fifth_power(float x)
{
    float squared = x * x;
    return squared * squared * x;
}

// D, 1/sr; from the squared sine, of which a narrow lobe keeps its digits.
float ggx_density(vec3 h, float alpha)
{
    float squared = alpha * alpha;
    float spread = h.x * h.x + h.y * h.y + squared * h.z * h.z;
    return divide(squared, 3.14159265358979324 * spread * spread);
}

float ggx_root(float alpha, float cosine)
{
    return sqrt(alpha * alpha + (1.0 - alpha * alpha) * cosine * cosine);
}

// Masking of both directions over 4 n.l n.v.
float ggx_visibility(float alpha, float cos_l, float cos_v)
{
    return divide(0.5, cos_l * ggx_root(alpha, cos_v) + cos_v * ggx_root(alpha, cos_l));
}

vec3 to_facets(Facets facets, vec3 w)
{
    if (HAS_ANISOTROPY && facets.is_stretched) {
        return vec3(dot(w, facets.tangent), dot(w, cross(facets.n, facets.tangent)), dot(w, facets.n));
    }
    return to_local(w, facets.n);
}

vec3 from_facets(Facets facets, vec3 local)
{
    if (HAS_ANISOTROPY && facets.is_stretched) {
        return local.x * facets.tangent + local.y * cross(facets.n, facets.tangent) + local.z * facets.n;
    }
    return to_frame(local, facets.n);
}

// D of a local normal, 1/sr.
float facet_density(Facets facets, vec3 h)
{
    if (HAS_ANISOTROPY && facets.is_stretched) {
        float product = facets.alpha * facets.alpha_along, ratio = divide(facets.alpha, facets.alpha_along);
        float spread = ratio * h.x * h.x + divide(h.y * h.y, ratio) + product * h.z * h.z;
        return divide(product, 3.14159265358979324 * spread * spread);
    }
    return ggx_density(h, facets.alpha);
}

float facet_root(Facets facets, vec3 w, float cosine)
{
    if (HAS_ANISOTROPY && facets.is_stretched) {
        vec2 beside = vec2(facets.alpha_along, facets.alpha) * vec2(dot(w, facets.tangent), dot(w, cross(facets.n, facets.tangent)));
        return sqrt(dot(beside, beside) + cosine * cosine);
    }
    return ggx_root(facets.alpha, cosine);
}

// Masking of both directions over 4 n.l n.v.
float facet_visibility(Facets facets, vec3 wi, vec3 wo, float cos_l, float cos_v)
{
    return divide(0.5, cos_l * facet_root(facets, wo, cos_v) + cos_v * facet_root(facets, wi, cos_l));
}

// Masking of one direction over its cosine.
float facet_masking(Facets facets, vec3 w, float cosine)
{
    return divide(2.0, cosine + facet_root(facets, w, cosine));
}

// A normal as often as v sees it (Dupuy and Benyoub 2023). Its density is masking * max(v.h, 0) * D.
vec3 sample_visible_normal(Facets facets, vec3 v, vec2 u)
{
    vec2 alpha = vec2(facets.alpha);
    if (HAS_ANISOTROPY) {
        alpha.x = facets.is_stretched ? facets.alpha_along : facets.alpha;
    }
    vec3 stretched = normalize(vec3(alpha * v.xy, v.z));
    float z = (1.0 - u.x) * (1.0 + stretched.z) - stretched.z;
    vec3 h = direction_at(z, (1.0 - z) * (1.0 + z), u.y) + stretched;
    return normalize(vec3(alpha * h.xy, max(h.z, 1e-12)));
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

// BRDF or BTDF times the cosine of facets that are no delta, but for its colour; the density of its sampling, 1/sr; and v.h.
struct Weighed {
    float value;
    float density;
    float along;
};

Weighed weigh_reflection(Facets facets, vec3 wo, vec3 wi)
{
    float cos_l = dot(wi, facets.n), cos_v = dot(wo, facets.n);
    if (cos_l <= 0.0 || cos_v <= 0.0) {
        return Weighed(0.0, 0.0, 1.0);
    }
    vec3 h = normalize(wo + wi);
    float density = facet_density(facets, to_facets(facets, h));
    float value = density * facet_visibility(facets, wi, wo, cos_l, cos_v) * cos_l;
    return Weighed(value, 0.25 * density * facet_masking(facets, wo, cos_v), dot(wo, h));
}

// A microfacet that was chosen as often as wo sees it; of what is as good as smooth, the surface itself.
struct SampledFacet {
    vec3 normal;
    float along; // v.h
    float masking; // of wo over its cosine, which is cos_v
    float cos_v;
    bool is_delta;
    float density; // of its normal, 1/sr, times the probability of its lobe; 0: a delta's
};

SampledFacet sample_facet(Facets facets, bool is_delta, vec3 wo, vec2 u, float chance)
{
    float cos_v = max(dot(wo, facets.n), 1e-6);
    SampledFacet facet = SampledFacet(facets.n, 0.0, facet_masking(facets, wo, cos_v), cos_v, is_delta, 0.0);
    if (!is_delta) {
        vec3 local = sample_visible_normal(facets, to_facets(facets, wo), u);
        facet.density = chance * facet.masking * facet_density(facets, local);
        facet.normal = from_facets(facets, local);
    }
    facet.along = clamp(dot(wo, facet.normal), 0.0, 1.0);
    return facet;
}

// Light leaves a facet along wi, at a cosine cos_l to the surface, on a side of its triangle: all but its colour.
Scatter leave_facet(Facets facets, SampledFacet facet, vec3 wo, vec3 wi, float cos_l, vec3 side, float chance)
{
    float weight = divide(1.0, chance);
    bool is_alive = true;
    if (facet.is_delta) {
        wi = on_side(wi, side);
    } else {
        is_alive = cos_l > 0.0;
        weight *= divide(4.0 * facet_visibility(facets, wi, wo, max(cos_l, 1e-6), facet.cos_v) * cos_l, facet.masking);
    }
    return Scatter(wi, vec3(weight), is_alive && dot(wi, side) > 0.0, true, false, facet.density);
}

// Where it goes on that is reflected.
vec3 reflect_at_facet(inout SampledFacet facet, vec3 wo)
{
    facet.density *= 0.25;
    return 2.0 * facet.along * facet.normal - wo;
}
