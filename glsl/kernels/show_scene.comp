// What the film of a scene holds after whole rounds, with those of the block under way: light, a part of it, or its error.
// Dispatched by src/engine/scene/live.rs. One thread = one pixel of the film.
#extension GL_EXT_scalar_block_layout : require

// What a window shows of a scene's film; see `glsl/kernels/show_scene.comp`.
struct ShowScenePush {
    uint pixel_count;
    // SHOW_...
    uint shows;
    uint rounds;
    // Whole blocks, and the rounds of these.
    uint blocks;
    uint rounds_of_blocks;
    // W/m2/sr of a film unit.
    float unit;
    // Mean radiance of the picture, of which errors are relative.
    float mean;
};

layout(push_constant, scalar) uniform Push { ShowScenePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer FilmSums { uvec2 film_sums[]; };
layout(set = 1, binding = 1, scalar) readonly buffer FilmSquares { uvec4 film_squares[]; };
layout(set = 1, binding = 2, scalar) readonly buffer SumsOfBlock { uvec2 sums_of_block[]; };
layout(set = 1, binding = 3, scalar) readonly buffer PartSums { uvec2 part_sums[]; };
layout(set = 1, binding = 4, scalar) buffer PartTotals { uint part_totals[]; };
// Radiance; or the relative error, negative where it is unknown, three times.
layout(set = 1, binding = 5, scalar) writeonly buffer Shown { vec4 shown[]; };

#include "dispatch/dispatch.glsl"
#include "math/math.glsl"
#include "world/scene/effects.glsl"
#include "film/wide.glsl"
#include "film/deviation.glsl"
#include "rng/hash.glsl"
#include "film/kept_places.glsl"
#include "film/kept_parts.glsl"

float float_of_sum(uvec2 sum)
{
    return float(sum.y) * 4294967296.0 + float(sum.x);
}

// Of a part other than direct light, in all rounds.
float part_of(uint pixel, uint part, uint channel)
{
    uint under_way = place_of_pixel_part(pixel, push.pixel_count, part, channel);
    uvec2 whole = part_sums[((PART_COUNT - 1) * pixel + part - 1) * 3 + channel];
    return float_of_sum(add64(whole, uvec2(part_totals[under_way], part_totals[under_way + 1])));
}

vec3 light_of(uint pixel)
{
    vec3 light;
    for (uint channel = 0; channel < 3; channel++) {
        uint place = 3 * pixel + channel;
        float all = float_of_sum(add64(film_sums[place], sums_of_block[place]));
        if (HAS_PARTS && push.shows != SHOW_ALL) {
            uint part = push.shows - SHOW_DIRECT;
            if (part == 0) {
                for (uint other = 1; other < PART_COUNT; other++) {
                    all = max(all - part_of(pixel, other, channel), 0.0);
                }
            } else {
                all = part_of(pixel, part, channel);
            }
        }
        light[channel] = all;
    }
    return light * divide(push.unit, float(max(push.rounds, 1)));
}

// Standard error of the mean over the channels, over the mean of the picture; -1 where it is unknown.
float error_of(uint pixel)
{
    float variance = 0.0;
    for (uint channel = 0; channel < 3; channel++) {
        uint place = 3 * pixel + channel;
        variance += variance_of_sum(film_sums[place], film_squares[place], push.blocks);
    }
    if (push.blocks < 2 || variance == 0.0) {
        return -1.0;
    }
    return divide(square_root(variance * (1.0 / 3.0)) * push.unit, float(push.rounds_of_blocks) * push.mean);
}

void main()
{
    uint pixel = invocation_index();
    if (pixel >= push.pixel_count) {
        return;
    }
    shown[pixel] = vec4(push.shows == SHOW_ERROR ? vec3(error_of(pixel)) : light_of(pixel), 1.0);
}
