// What all lobes share: where light goes on, and the optics of a boundary.

#include "math/math.glsl"

struct Scatter {
    vec3 direction;
    vec3 weight; // f * cosine / pdf
    bool alive;
    bool is_specular; // by a lobe that rays follow; photon maps know the others
    bool passes; // straight, as if no surface were there
    float density; // of the direction, 1/sr; 0: that of a delta, of the diffuse lobe or of sheen
};

vec3 mirrored(vec3 w, vec3 n)
{
    return 2.0 * dot(w, n) * n - w;
}

// A direction on the side that a unit vector points to. A shading normal may send a mirrored or refracted ray to the wrong side
// of its triangle; mirrored in the triangle's plane, as if it met the surface once more, it leaves with all of its light.
vec3 on_side(vec3 direction, vec3 side)
{
    return direction - 2.0 * min(dot(direction, side), 0.0) * side;
}

// Fresnel reflectance of unpolarised light; eta = n_i / n_t.
float fresnel(float cos_i, float cos_t, float eta)
{
    float parallel = divide(cos_i - eta * cos_t, cos_i + eta * cos_t);
    float perpendicular = divide(eta * cos_i - cos_t, eta * cos_i + cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// Square of the refracted ray's cosine, exact where the index is 1; 0 or less in total internal reflection.
float refracted_cosine_squared(float cos_i, float eta)
{
    return eta * eta * cos_i * cos_i + (1.0 - eta) * (1.0 + eta);
}

// Exact Fresnel reflectance at a cosine; 1 in total reflection.
float reflectance_at(float cosine, float eta)
{
    float cos_t_squared = refracted_cosine_squared(cosine, eta);
    return cos_t_squared > 0.0 ? fresnel(cosine, sqrt(cos_t_squared), eta) : 1.0;
}

// What a shading normal changes about a photon's flux (Veach 1997, section 5.3): the ratio of the cosines
// that the light sees to those that the eye sees.
float shading_gain(float shading_cosine, float geometric_cosine)
{
    return min(divide(abs(shading_cosine), max(abs(geometric_cosine), 1e-6)), float(MAX_SHADING_GAIN));
}

// The share of a light sample that counts beside the sampling of a lobe (the balance heuristic, Veach 1997, section 9.2); 0: no ray of
// a lobe meets this light.
float light_share(float light_density, float lobe_density)
{
    return light_density > 0.0 ? divide(light_density, light_density + lobe_density) : 1.0;
}

float largest(vec3 v)
{
    return max(v.x, max(v.y, v.z));
}
