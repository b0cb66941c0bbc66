// One atomic per subgroup instead of one per thread: ballots find the survivors, exclusive bit counts their order, and a broadcast
// says where the subgroup's block begins.

const uint PLACES = PATHS_EACH;

uint[PLACES] take_places(uint counter, bool[PLACES] wanted)
{
    uint[PLACES] places;
    uint count = 0;
    for (uint k = 0; k < PLACES; k++) {
        uvec4 survivors = subgroupBallot(wanted[k]);
        places[k] = count + subgroupBallotExclusiveBitCount(survivors);
        count += subgroupBallotBitCount(survivors);
    }
    uint base = 0;
    if (count != 0 && subgroupElect()) {
        base = atomicAdd(counters[counter], count);
    }
    base = subgroupBroadcastFirst(base);
    for (uint k = 0; k < PLACES; k++) {
        places[k] += base;
    }
    return places;
}

#include "builder/compact.glsl"
