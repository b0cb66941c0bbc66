// Thin films over a base: light that is reflected at both of their boundaries interferes (Belcour and Barla 2017, as
// KHR_materials_iridescence has it).

#include "rng/sampling.glsl"
#include "material/ggx.glsl"

// A thin film on the base: how much of it is there, and shares of dielectric and metal in what is reflected below it, with their F0.
struct RoughFilm {
    float share;
    float ior;
    float thickness;
    float dielectric;
    vec3 f0;
    float metal;
    vec3 metal_f0;
    // What it reflects is no sharp lobe.
    uint is_rough;
};

RoughFilm no_film()
{
    return RoughFilm(0.0, 1.0, 0.0, 0.0, vec3(0.0), 0.0, vec3(0.0), 0);
}

// Amplitude of a wave of this phase shift, for X, Y, Z of the observer: Gaussians in the frequency's Fourier space.
vec3 sensitivity(float path, vec3 shift)
{
    // Of 1/m; beyond there is no interference left to see.
    float phase = 6.28318530717958648e-9 * min(path, 1e5);
    float squared = -1.44269504088896341 * phase * phase;
    const vec4 values = vec4(5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14);
    const vec4 places = vec4(1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6);
    const vec4 variances = vec4(4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9);
    vec4 shifts = vec4(shift, shift.x);
    float waves[4];
    for (uint k = 0; k < 4; k++) {
        float turns = 0.15915494309189535 * (places[k] * phase + shifts[k]);
        waves[k] = values[k] * sqrt(6.28318530717958648 * variances[k]) * sin_cos_turns(turns - floor(turns)).y * exp2(variances[k] * squared);
    }
    vec3 xyz = vec3(waves[0] + waves[3], waves[1], waves[2]) * (1.0 / 1.0685e-7);
    return vec3(3.2404542 * xyz.x - 1.5371385 * xyz.y - 0.4985314 * xyz.z, -0.9692660 * xyz.x + 1.8760108 * xyz.y + 0.0415560 * xyz.z,
                0.0556434 * xyz.x - 0.2040259 * xyz.y + 1.0572252 * xyz.z);
}

float reflected_along(float a, float b)
{
    float r = divide(a - b, a + b);
    return r * r;
}

float schlick(float f0, float cosine)
{
    return f0 + (1.0 - f0) * fifth_power(clamp(1.0 - cosine, 0.0, 1.0));
}

// What a film of this index and thickness (nanometres) in air reflects of light that meets it at a cosine, over a base that reflects f0
// in air along the normal.
vec3 film_reflectance(vec3 f0, float film_ior, float thickness, float cosine)
{
    // Where it ends it is air.
    float share = clamp(thickness * (1.0 / 0.03), 0.0, 1.0);
    float ior = 1.0 + (film_ior - 1.0) * (share * share * (3.0 - 2.0 * share));
    float squared = 1.0 - divide(1.0 - cosine * cosine, ior * ior);
    if (squared <= 0.0) {
        return vec3(1.0);
    }
    float inside = sqrt(squared);
    float first = schlick(reflected_along(ior, 1.0), cosine);
    float through = 1.0 - first;
    vec3 second, shift;
    for (uint k = 0; k < 3; k++) {
        float root = sqrt(clamp(f0[k], 0.0, 0.9999));
        float base_ior = divide(1.0 + root, 1.0 - root);
        second[k] = schlick(reflected_along(base_ior, ior), inside);
        shift[k] = 3.14159265358979324 + (base_ior < ior ? 3.14159265358979324 : 0.0);
    }
    vec3 both = clamp(first * second, vec3(1e-5), vec3(0.9999));
    vec3 often = vec3(0.0), root = vec3(0.0);
    for (uint k = 0; k < 3; k++) {
        often[k] = divide(through * through * second[k], 1.0 - both[k]);
        root[k] = sqrt(both[k]);
    }
    float path = 2.0 * ior * thickness * inside;
    vec3 amplitude = (often - through) * root;
    vec3 sum = first + often + 2.0 * amplitude * sensitivity(path, shift) + 2.0 * amplitude * root * sensitivity(2.0 * path, 2.0 * shift);
    return clamp(sum, vec3(0.0), vec3(1.0));
}

// What a base reflects that has a film: of the dielectric, and of the metal.
vec3 under_film(vec3 colour, RoughFilm film, float cosine)
{
    vec3 interference = vec3(0.0);
    if (film.dielectric > 0.0) {
        interference += film.dielectric * film_reflectance(film.f0, film.ior, film.thickness, cosine);
    }
    if (film.metal > 0.0) {
        interference += film.metal * film_reflectance(film.metal_f0, film.ior, film.thickness, cosine);
    }
    return (1.0 - film.share) * colour + film.share * interference;
}
