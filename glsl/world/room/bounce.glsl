// What a builder asks about the bounce under way: list, slots, capacity, whether another follows.

uint photon_capacity()
{
    return push.photon_capacity;
}

// counters[1 + incoming_list()] is the number of paths that enter, counters[2 + incoming_list()] that of those that go on.
uint incoming_list()
{
    return push.bounce;
}

// Where photon `index` of `photon_count` has its slot.
uint slot_of(uint index, uint photon_count)
{
    return push.bounce * photon_count + index;
}

// Whether a slot is written though nothing is stored in it.
bool clears_slot()
{
    return true;
}

// Whether another bounce will read what this one hands on.
bool has_next_bounce()
{
    return push.bounce + 1 < push.bounces;
}

// What the ledger needs, it has: fates.
void cut_off(PhotonState path)
{
}

uint tally_row(uint bounce)
{
    return bounce;
}

// Counters of the photon map and of the lists, before those that the atomic builder may use besides.
uint lists_end()
{
    return push.bounces + 2;
}

// Nobody asks how many paths the naive builder has left.
void count_left(bool goes_on)
{
}
