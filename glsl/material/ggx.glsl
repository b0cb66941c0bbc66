// GGX with correlated Smith masking (Heitz 2014), in frames whose z is the normal. Cosines are above 0.

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

// Masking of one direction over its cosine.
float ggx_masking(float alpha, float cosine)
{
    return divide(2.0, cosine + ggx_root(alpha, cosine));
}

// A normal as often as v sees it (Dupuy and Benyoub 2023). Its density is masking * max(v.h, 0) * D.
vec3 sample_visible_normal(vec3 v, float alpha, vec2 u)
{
    vec3 stretched = normalize(vec3(alpha * v.xy, v.z));
    float z = (1.0 - u.x) * (1.0 + stretched.z) - stretched.z;
    vec3 h = direction_at(z, (1.0 - z) * (1.0 + z), u.y) + stretched;
    return normalize(vec3(alpha * h.xy, max(h.z, 1e-12)));
}
