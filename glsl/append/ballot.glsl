// The modified store with one atomic a subgroup instead of one a thread: a ballot finds the
// survivors, an exclusive bit count their order, and a broadcast tells them where the subgroup's
// block begins.

uint incoming_count(uint bounce)
{
    return min(counters[1 + bounce], push.path_capacity);
}

// First place of a block of `count` for this subgroup.
uint reserve(uint counter, uint count)
{
    uint base = 0;
    if (subgroupElect()) {
        base = atomicAdd(counters[counter], count);
    }
    return subgroupBroadcastFirst(base);
}

bool append_survivor(uint index, Photon photon, Path path, bool alive)
{
    uvec4 survivors = subgroupBallot(alive);
    uint survivor_count = subgroupBallotBitCount(survivors);
    if (survivor_count == 0) {
        return false;
    }
    uint photon_slot = reserve(0, survivor_count) + subgroupBallotExclusiveBitCount(survivors);
    bool stored = alive && photon_slot < push.photon_capacity;

    uvec4 kept = subgroupBallot(stored);
    uint path_slot = reserve(2 + push.bounce, subgroupBallotBitCount(kept)) + subgroupBallotExclusiveBitCount(kept);
    if (stored) {
        photons[photon_slot] = photon;
        next_paths[path_slot] = path;
    }
    return stored;
}
