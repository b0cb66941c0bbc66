// The copy of a bounce's tally that this work group counts in; src/engine/tallies.rs adds them up.

// Fates of the paths that entered one bounce.
struct Tally {
    uint stored;
    uint absorbed;
    uint escaped;
    uint dropped;
};

uint tally_copy(uint bounce)
{
    return bounce * TALLY_COPIES + work_group_index() % TALLY_COPIES;
}
