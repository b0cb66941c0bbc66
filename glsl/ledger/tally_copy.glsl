// The copy of a bounce's tally that this work group counts in; src/engine/tallies.rs adds them up.

uint tally_copy(uint bounce)
{
    return bounce * TALLY_COPIES + work_group_index() % TALLY_COPIES;
}
