// The paper's modified store (section 3): every survivor takes the next place by an atomic of its own. From several counters,
// which work groups use round-robin, where COUNTERS is above 1.

const uint PLACES = 1;

#include "builder/striped_counters.glsl"

uint[PLACES] take_places(uint counter, bool[PLACES] wanted)
{
    if (COUNTERS == 1) {
        return uint[](wanted[0] ? atomicAdd(counters[counter], 1) : 0);
    }
    uint turn = work_group_index() % COUNTERS;
    return uint[](wanted[0] ? striped_place(turn, atomicAdd(counters[striped_counter(turn)], 1)) : 0);
}

#include "builder/compact.glsl"
