// The next free place of one counter, by one atomic a subgroup: a ballot finds the survivors, an exclusive bit count their order, and a broadcast tells them where the subgroup's
// block begins.

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
