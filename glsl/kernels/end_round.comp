// Ends a round of the paper's box: what it left on the film joins the sums of all rounds, its square the sums of
// squares, and the film is empty for the next round. Of some points the sum itself is kept, for the latest rounds.
// Dispatched by src/engine/room/estimate.rs once a round. One thread = one film sum.
// Squares lie in two buffers, 64 bits each, so that none is larger than twice the film.
#extension GL_EXT_scalar_block_layout : require

struct EndRoundPush {
    uint sum_count;
    // Sums of each point.
    uint channel_count;
    uint round;
};

layout(push_constant, scalar) uniform Push { EndRoundPush push; };
layout(set = 1, binding = 0, scalar) buffer Film { uvec2 film[]; };
layout(set = 1, binding = 1, scalar) buffer FilmTotals { uvec2 film_totals[]; };
layout(set = 1, binding = 2, scalar) buffer LowSquares { uvec2 low_squares[]; };
layout(set = 1, binding = 3, scalar) buffer HighSquares { uvec2 high_squares[]; };

#include "dispatch/dispatch.glsl"
#include "film/wide.glsl"
#include "rng/hash.glsl"
#include "film/kept_places.glsl"
#include "film/latest_blocks.glsl"

void main()
{
    uint sum = invocation_index();
    if (sum >= push.sum_count) {
        return;
    }
    uvec2 of_round = film[sum];
    film[sum] = uvec2(0);
    film_totals[sum] = add64(film_totals[sum], of_round);
    uvec4 square = add128(uvec4(low_squares[sum], high_squares[sum]), square64(of_round));
    low_squares[sum] = square.xy;
    high_squares[sum] = square.zw;
    uint point_count = push.sum_count / push.channel_count;
    uint kept = kept_number(sum / push.channel_count, point_count);
    if (sum % push.channel_count == 0 && kept != NONE) {
        latest_blocks[first_of_block(push.round, point_count) + kept] = float_of(of_round);
    }
}
