// Directions from uniform numbers. Twin of src/cpu/sampling.rs; `precise` keeps the operations apart,
// so that every kernel and the twin round alike.

#include "world/room/walls.glsl"

// (sin, cos) of `turns` full turns, turns in [0, 1). Vulkan promises sin and cos only to 2^-11, so
// the angle is reduced to an eighth of a turn, exactly, and a Taylor polynomial (error 1e-8) does
// the rest.
vec2 sin_cos_turns(float turns)
{
    precise float quarter = roundEven(4.0 * turns);
    precise float z = 6.28318530717958648 * (turns - 0.25 * quarter);
    precise float z2 = z * z;
    precise float s = z + z * z2 * (-1.0 / 6.0 + z2 * (1.0 / 120.0 + z2 * (-1.0 / 5040.0 + z2 * (1.0 / 362880.0))));
    precise float c = 1.0 - 0.5 * z2 + z2 * z2 * (1.0 / 24.0 + z2 * (-1.0 / 720.0 + z2 * (1.0 / 40320.0)));
    uint quadrant = uint(quarter) & 3u;
    vec2 rotated = (quadrant & 1u) == 0u ? vec2(s, c) : vec2(c, -s);
    return (quadrant & 2u) == 0u ? rotated : -rotated;
}

// Local direction (tangent, bitangent, normal) at the given cosine and squared sine.
vec3 direction_at(float cosine, float sine_squared, float azimuth)
{
    vec2 sin_cos = sin_cos_turns(azimuth);
    precise float sine = sqrt(max(sine_squared, 0.0));
    precise vec2 flat_part = sine * sin_cos.yx;
    return vec3(flat_part, cosine);
}

// A number that is 0 stands for what lies below a generator's last bit: no direction lies in the surface.
const float LEAST = 1.0 / 33554432.0;

// pdf = cosine / pi.
vec3 sample_cosine_hemisphere(float u, float azimuth)
{
    u = max(u, LEAST);
    return direction_at(sqrt(u), 1.0 - u, azimuth);
}

// pdf = 1 / (2 pi).
vec3 sample_uniform_hemisphere(float u, float azimuth)
{
    u = max(u, LEAST);
    precise float sine_squared = (1.0 - u) * (1.0 + u);
    return direction_at(u, sine_squared, azimuth);
}

// pdf = 1 / (4 pi).
vec3 sample_sphere(float u, float azimuth)
{
    return direction_at(1.0 - 2.0 * u, 4.0 * u * (1.0 - u), azimuth);
}

// Around the z axis, pdf = (exponent + 1) / (2 pi) cosine^exponent. The cosine is u^(1 / (exponent + 1)). Its distance
// from 1 is made by itself, as there are few numbers next to 1: of exponent 10^6 the cosine has 190 values.
vec3 sample_lobe(float exponent, float u, float azimuth)
{
    float power = divide(log2(max(u, LEAST)), exponent + 1.0);
    float cosine = exp2(power);
    float x = -0.69314718055994531 * power;
    // 1 - exp(-x), by its series where the difference would lose digits.
    float below_one = x < 0.0078125 ? x * (1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0))) : 1.0 - cosine;
    return direction_at(cosine, below_one * (1.0 + cosine), azimuth);
}

// From a wall's frame to world axes. The frames of a room are axes, so each sum has one term.
vec3 to_world(vec3 local, Wall wall)
{
    precise vec3 world = local.x * wall.tangent + local.y * wall.bitangent + local.z * wall.normal;
    return world;
}
