// The next free place of one counter, by one atomic per subgroup: builder/ballot.glsl for one photon, as builder/persistent.glsl takes it.

uint take_place(uint counter, bool wanted)
{
    uvec4 survivors = subgroupBallot(wanted);
    uint survivor_count = subgroupBallotBitCount(survivors);
    uint base = 0;
    if (survivor_count != 0 && subgroupElect()) {
        base = atomicAdd(counters[counter], survivor_count);
    }
    return subgroupBroadcastFirst(base) + subgroupBallotExclusiveBitCount(survivors);
}
