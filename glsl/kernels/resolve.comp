// Ends a round: what the paths of each pixel found and what their points were lit by joins the sums of its block. At the end of a
// block the film takes these sums and their squares, and they are empty for the next one. All of that twice for a
// picture: of all light, and of what surfaces scatter, which errors refer to. Of some pixels the parts of a block's light are kept;
// where a picture keeps its parts, those of all pixels join the sums of theirs.
// Dispatched by src/engine/scene/estimate.rs once a round. One thread = one pixel or receiver.
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/work.glsl"

struct ResolvePush {
    WorkDivision work;
    uint first_pixel;
    uint end_pixel;
    uint pixel_count;
    // Visible points of a path that photons may have lit.
    uint points_per_path;
    // Whether what paths find counts.
    uint counts_paths;
    uint block;
    // 1: it is the last round of its block.
    uint ends_block;
};

layout(push_constant, scalar) uniform Push { ResolvePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer PassSums { uvec2 pass_sums[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Estimates { uvec2 estimates[]; };
layout(set = 1, binding = 2, scalar) buffer FilmSums { uvec2 film_sums[]; };
layout(set = 1, binding = 3, scalar) buffer FilmSquares { uvec4 film_squares[]; };
// Of all pixels, then of kept places (film/kept_parts.glsl).
layout(set = 1, binding = 5, scalar) buffer PartTotals { uint part_totals[]; };
layout(set = 1, binding = 6, scalar) buffer SumsOfBlock { uvec2 sums_of_block[]; };
layout(set = 1, binding = 7, scalar) buffer SurfaceSumsOfBlock { uvec2 surface_sums_of_block[]; };
layout(set = 1, binding = 8, scalar) buffer SurfaceSums { uvec2 surface_sums[]; };
layout(set = 1, binding = 9, scalar) buffer SurfaceSquares { uvec4 surface_squares[]; };
// Parts of each pixel's light but direct light, as film/kept_parts.glsl has them in a block.
layout(set = 1, binding = 10, scalar) buffer PartSums { uvec2 part_sums[]; };

#include "dispatch/dispatch.glsl"
#include "world/scene/effects.glsl"
#include "world/scene/sample_places.glsl"
#include "world/scene/extra_samples.glsl"
#include "film/wide.glsl"
#include "rng/hash.glsl"
#include "film/kept_places.glsl"
#include "film/latest_blocks.glsl"
#include "film/kept_parts.glsl"

void main()
{
    uint pixel = push.first_pixel + invocation_index();
    if (pixel >= push.end_pixel) {
        return;
    }
    work = push.work;
    uint samples = samples_of(pixel);
    bool ends_block = push.ends_block != 0;
    uint kept = ends_block ? kept_number(pixel, push.pixel_count) : NONE;
    for (uint channel = 0; channel < 3; channel++) {
        uint place = 3 * pixel + channel;
        uvec2 sum = uvec2(0);
        for (uint number = 0; number < samples; number++) {
            if (push.counts_paths != 0) {
                sum = add64(sum, pass_sums[place_of_sums(place_of_sample(pixel, number, push.pixel_count)) + channel]);
            }
            for (uint k = 0; k < push.points_per_path; k++) {
                sum = add64(sum, estimates[3 * place_of_point(k, place_of_sample(pixel, number, push.pixel_count), push.pixel_count) + channel]);
            }
        }
        uvec2 surface = sum;
        if (HAS_SEEN_LIGHT) {
            for (uint number = 0; number < samples; number++) {
                sum = add64(sum, pass_sums[place_of_sums(place_of_sample(pixel, number, push.pixel_count)) + 3 + channel]);
            }
            surface = add64(surface_sums_of_block[place], surface);
            surface_sums_of_block[place] = ends_block ? uvec2(0) : surface;
        }
        sum = add64(sums_of_block[place], sum);
        sums_of_block[place] = ends_block ? uvec2(0) : sum;
        if (ends_block) {
            film_sums[place] = add64(film_sums[place], sum);
            film_squares[place] = add128(film_squares[place], square64(sum));
            if (HAS_SEEN_LIGHT) {
                surface_sums[place] = add64(surface_sums[place], surface);
                surface_squares[place] = add128(surface_squares[place], square64(surface));
            }
        }
        if (HAS_PARTS && ends_block) {
            for (uint part = 1; part < PART_COUNT; part++) {
                uint from = place_of_pixel_part(pixel, push.pixel_count, part, channel);
                uint to = ((PART_COUNT - 1) * pixel + part - 1) * 3 + channel;
                part_sums[to] = add64(part_sums[to], uvec2(part_totals[from], part_totals[from + 1]));
                part_totals[from] = 0;
                part_totals[from + 1] = 0;
            }
        }
        if (kept != NONE) {
            for (uint part = 0; part < PART_COUNT; part++) {
                uint from = place_of_part(kept, part, channel);
                uint to = (PART_COUNT * (first_of_block(push.block, push.pixel_count) + kept) + part) * 3 + channel;
                latest_blocks[to] = float_of(uvec2(part_totals[from], part_totals[from + 1]));
                part_totals[from] = 0;
                part_totals[from + 1] = 0;
            }
        }
    }
}
