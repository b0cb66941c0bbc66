// Ends a block: its row of what a smaller radius would change joins the row that its number shares with others, and is empty for the
// next block. Dispatched by src/engine/scene/estimate.rs once a block. One thread = one sum.
#extension GL_EXT_scalar_block_layout : require

struct EndDifferencePush {
    uint row_length;
    uint block;
};

layout(push_constant, scalar) uniform Push { EndDifferencePush push; };
layout(set = 1, binding = 0, scalar) buffer Differences { uvec2 differences[]; };

#include "dispatch/dispatch.glsl"
#include "film/wide.glsl"

void main()
{
    uint sum = invocation_index();
    if (sum >= push.row_length) {
        return;
    }
    uint row = push.block % DIFFERENCE_ROWS * push.row_length + sum;
    uint under_way = DIFFERENCE_ROWS * push.row_length + sum;
    // Behind the sums stands how many blocks a row has.
    bool is_count = sum + 1 == push.row_length;
    differences[row] = add64(differences[row], is_count ? uvec2(1, 0) : differences[under_way]);
    differences[under_way] = uvec2(0);
}
