// The walls that cut off the disc of each visible point's density estimates, of the round under way.

#include "gather/cuts.glsl"

// The reach, as a float's bits, and a line in each other word; `NONE`: none.
layout(set = 1, binding = 13, scalar) buffer DiscCuts { uvec4 disc_cuts[]; };

// The cuts of number `cut`: those of the points of one map follow those of another. Photons lie within `radius`.
Cuts cuts_of(uint cut, vec3 normal, float radius)
{
    Cuts cuts = no_cuts(radius);
    if (HAS_EDGE_CORRECTION) {
        uvec4 words = disc_cuts[cut];
        cuts.reach = uintBitsToFloat(words.x);
        [[unroll]] for (uint k = 0; k < CUT_LINES; k++) {
            cuts.lines[k] = unpack_cut(words[1 + k], normal, cuts.reach);
        }
    }
    return cuts;
}
