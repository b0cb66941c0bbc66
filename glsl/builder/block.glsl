// One atomic a subgroup for the survivors of several paths of each invocation; ballot.glsl is this for one path, and made
// builder/trace_persistent.glsl 7 % faster on an NVIDIA H200.

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
