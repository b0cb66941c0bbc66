// One bounce of every path. Photons that are stored and paths that go on each take the next place, so that there are no gaps but
// those of several counters (builder/striped_counters.glsl). An invocation takes `PLACES` paths through it: a device adds only so often a second to one counter, and more of them share an addition.
// builder/atomic.glsl, builder/ballot.glsl and builder/group.glsl each define
//
//   uint[PLACES] take_places(uint counter, bool[PLACES] wanted)
//       called by all invocations of a work group together; the next free places that `counter` counts, where one is
//       wanted.
//
// counters[0] is the length of the photon map, the others the lengths of the lists of paths (world/*/bounce.glsl).
// Counters run on when the map is full: readers take the smaller of counter and capacity.

void trace()
{
    uint path_count = min(counters[1 + incoming_list()], push.path_capacity);
    uint row = (path_count + PLACES - 1) / PLACES;
    uint column = invocation_index();
    PhotonState[PLACES] path;
    Step[PLACES] taken;
    bool[PLACES] stored;
    bool[PLACES] goes_on;
    [[unroll]] for (uint k = 0; k < PLACES; k++) {
        uint index = k * row + column;
        taken[k] = no_step();
        if (column < row && index < path_count) {
            path[k] = incoming_path(index);
            // Gaps of several counters; nobody else leaves any.
            if (is_path(path[k])) {
                taken[k] = step_path(path[k], push.bounce);
            }
        }
        stored[k] = taken[k].stored;
        goes_on[k] = taken[k].alive && (STORED_IS_ALIVE || has_next_bounce());
        if (taken[k].alive && !goes_on[k]) {
            cut_off(path[k]);
        }
    }
    uint[PLACES] path_places = take_places(2 + incoming_list(), goes_on);
    uint[PLACES] photon_places = path_places;
    if (!STORED_IS_ALIVE) {
        photon_places = take_places(0, stored);
    }
    uvec4 counts = uvec4(0);
    [[unroll]] for (uint k = 0; k < PLACES; k++) {
        // The photons of earlier bounces come first.
        uint photon_place = photon_places[k] + (STORED_IS_ALIVE ? counters[0] : 0);
        bool fits = stored[k] && photon_place < photon_capacity();
        if (fits) {
            store_photon(photon_place, taken[k].photon);
        }
        // Places are never more than the incoming paths, up to a whole work group, so this one always fits.
        if (goes_on[k] && (fits || !STORED_IS_ALIVE) && has_next_bounce()) {
            store_path(path_places[k], path[k]);
        }
        counts += fates(STORED_IS_ALIVE ? fits : taken[k].alive, taken[k].absorbed, taken[k].escaped, stored[k] && !fits);
    }
    tally(tally_row(push.bounce), counts);
}
