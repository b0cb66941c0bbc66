// What a builder asks about the bounce under way: list, slots, capacity, whether another follows.

uint photon_capacity()
{
    return push.map.photon_capacity;
}

// counters[1 + incoming_list()] is the number of paths that enter, counters[2 + incoming_list()] that of those that go on.
uint incoming_list()
{
    return push.list;
}

// Where photon `index` of `photon_count` has its slot: one for each flight, where it may land more than once.
uint slot_of(uint index, uint photon_count)
{
    return push.map.lands_once != 0 ? index : push.list * photon_count + index;
}

// Whether a slot is written though nothing is stored in it.
bool clears_slot()
{
    return push.map.lands_once == 0 || push.list == 0;
}

// Whether another bounce will read what this one hands on.
bool has_next_bounce()
{
    return push.is_last == 0;
}

// A path that is alive, but allowed no further bounce.
void cut_off(PhotonState path)
{
    count_loss(TOTAL_CUT_OFF, path.flux);
}

uint tally_row(uint bounce)
{
    return min(bounce, TALLY_ROWS - 1);
}

// A scene's map and its paths have one counter each.
uint lists_end()
{
    return 0;
}

// How many paths the naive builder has left, where the host looks at it.
void count_left(bool goes_on)
{
    if (push.counts_left != 0) {
        uint count = subgroupBallotBitCount(subgroupBallot(goes_on));
        if (count != 0 && subgroupElect()) {
            atomicAdd(counters[2 + push.list], count);
        }
    }
}
