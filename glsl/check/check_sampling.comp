// The functions that sample, at given random words.
// Dispatched by src/gpu/check.rs. One thread = one case.
#include "records.glsl"

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
