// Ends a round: what the paths of each pixel found and what their points were lit by is added up, and the film takes the
// sum and its square. Of some pixels the sum itself is kept, for the latest rounds.
// Dispatched by src/engine/scene/estimate.rs once a round. One thread = one pixel or receiver.
#include "records.glsl"

layout(push_constant, scalar) uniform Push { ResolvePush push; };
layout(set = 1, binding = 0, scalar) readonly buffer PassSums { uvec2 pass_sums[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Estimates { uvec2 estimates[]; };
layout(set = 1, binding = 2, scalar) buffer FilmSums { uvec2 film_sums[]; };
layout(set = 1, binding = 3, scalar) buffer FilmSquares { uvec4 film_squares[]; };

#include "dispatch/dispatch.glsl"
#include "world/scene/effects.glsl"
#include "film/wide.glsl"
#include "rng/hash.glsl"
#include "film/latest_rounds.glsl"

void main()
{
    uint pixel = push.first_pixel + invocation_index();
    if (pixel >= push.end_pixel) {
        return;
    }
    uint kept = kept_number(pixel, push.pixel_count);
    for (uint channel = 0; channel < 3; channel++) {
        uvec2 sum = uvec2(0);
        for (uint number = 0; number < SAMPLES; number++) {
            sum = add64(sum, pass_sums[3 * (SAMPLES * pixel + number) + channel]);
        }
        for (uint k = 0; k < push.points_per_pixel; k++) {
            sum = add64(sum, estimates[3 * (k * push.pixel_count + pixel) + channel]);
        }
        uint place = 3 * pixel + channel;
        film_sums[place] = add64(film_sums[place], sum);
        film_squares[place] = add128(film_squares[place], square64(sum));
        if (kept != NONE) {
            latest_rounds[3 * (first_of_round(push.round, push.pixel_count) + kept) + channel] = float_of(sum);
        }
    }
}
