// What a map's photons lose to limits, and how many photons the map has held, since the host last asked. A copy of
// TOTAL_WORDS words for each of TALLY_COPIES groups of work groups: photons cut off, photons clamped, the flux of the first and
// of the second (three channels of two words, low word first), and in the first copy photons stored (two words).
// src/engine/totals.rs adds the copies up.

layout(set = 1, binding = 8, scalar) buffer Totals { uint totals[]; };

const uint TOTAL_CUT_OFF = 0;
const uint TOTAL_CLAMPED = 1;
const uint TOTAL_STORED = 14;

// Adds one photon, cut off or clamped, and the flux that it loses.
void count_loss(uint kind, vec3 flux)
{
    uint copy = TOTAL_WORDS * (work_group_index() % TALLY_COPIES);
    atomicAdd(totals[copy + kind], 1);
    for (uint channel = 0; channel < 3; channel++) {
        uint word = copy + 2 + 6 * kind + 2 * channel;
        uint amount = uint(roundEven(clamp(flux[channel], 0.0, 2048.0) * float(1u << TOTAL_FLUX_BITS)));
        if (atomicAdd(totals[word], amount) > 0xffffffffu - amount) {
            atomicAdd(totals[word + 1], 1);
        }
    }
}
