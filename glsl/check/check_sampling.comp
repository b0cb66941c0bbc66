// The functions that sample, at given random words.
// Dispatched by src/gpu/check.rs. One thread = one case.
#extension GL_EXT_scalar_block_layout : require

// What the functions that sample are asked at.
struct SamplingCase {
    // Two random words, as the generator gives them.
    uvec2 words;
    // Of a disc, and of what is made into a frame or packed; a unit vector.
    vec3 normal;
    // Of a lobe.
    float exponent;
    // Unit vectors: corners of a spherical triangle.
    vec3 a;
    vec3 b;
    vec3 c;
};

// What the functions of `glsl/rng/sampling.glsl`, `glsl/world/scene/filter.glsl` and `glsl/world/scene` make of a case.
struct Samples {
    // Around the z axis.
    vec3 cosine_hemisphere;
    vec3 uniform_hemisphere;
    vec3 sphere;
    vec3 lobe;
    // A point of the unit disc around the origin.
    vec3 disc;
    // Barycentric.
    vec2 triangle;
    vec2 filter_offset;
    // A direction within the spherical triangle, and the angle that it was chosen from.
    vec3 in_triangle;
    float solid_angle;
    vec3 tangent;
    vec3 bitangent;
    // The normal, packed in 2 x 16 and in 2 x 15 bits.
    vec3 unpacked_normal;
    vec3 unpacked_direction;
};

layout(set = 1, binding = 0, scalar) readonly buffer Cases { SamplingCase cases[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Results { Samples results[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"
#include "rng/sampling.glsl"
#include "world/scene/effects.glsl"
#include "world/scene/filter.glsl"
#include "math/directions.glsl"
#include "world/scene/areas.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= cases.length()) {
        return;
    }
    SamplingCase at = cases[index];
    vec2 u = vec2(unit_float(at.words.x >> 8), unit_float(at.words.y >> 8));
    vec4 in_triangle = sample_spherical_triangle(at.a, at.b, at.c, u);
    Samples samples;
    samples.cosine_hemisphere = sample_cosine_hemisphere(u.x, u.y);
    samples.uniform_hemisphere = sample_uniform_hemisphere(u.x, u.y);
    samples.sphere = sample_sphere(u.x, u.y);
    samples.lobe = sample_lobe(at.exponent, u.x, u.y);
    samples.disc = sample_disc(vec3(0.0), at.normal, 1.0, u);
    samples.triangle = sample_triangle(u);
    samples.filter_offset = filter_offsets(u);
    samples.in_triangle = in_triangle.xyz;
    samples.solid_angle = in_triangle.w;
    samples.tangent = to_frame(vec3(1.0, 0.0, 0.0), at.normal);
    samples.bitangent = to_frame(vec3(0.0, 1.0, 0.0), at.normal);
    samples.unpacked_normal = unpack_normal(pack_normal(at.normal));
    samples.unpacked_direction = unpack_direction(pack_direction(at.normal, 3));
    results[index] = samples;
}
