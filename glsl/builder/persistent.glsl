// Photons from their light to their end, each in the registers of one invocation: within a dispatch no array of paths is read or
// written. An invocation whose photon has ended takes its next one in the same step in which its neighbours go on (persistent
// threads, Aila and Laine 2009), so that a subgroup stays full.
//
// The lanes of a subgroup vote in a loop in which they go different ways, so they must be together again at each vote. That is
// asked of the device where it offers it (src/gpu/reconvergence.rs), and the start-up check runs this very loop (check/start_up.glsl).

#include "builder/place.glsl"

void trace()
{
    open_tallies();
    uint next = invocation_index(); // photon of the dispatch to start with, then every `stride`th
    if (next >= push.stride) {
        next = photon_count();
    }
    bool under_way = false;
    uint bounce = 0;
    PhotonState path;
    for (;;) {
        if (!under_way && next < photon_count()) {
            path = take_photon(next);
            next += push.stride;
            bounce = first_bounce();
            under_way = true;
        }
        if (subgroupBallot(under_way) == uvec4(0)) {
            break;
        }
        Step taken = no_step();
        if (under_way) {
            taken = step_path(path, bounce);
        }
        uint place = take_place(0, taken.stored);
        bool fits = taken.stored && place < photon_capacity();
        if (fits) {
            store_photon(place, taken.photon);
        }
        bool alive = taken.alive && (fits || !STORED_IS_ALIVE);
        if (under_way) {
            count_fate(tally_row(bounce), alive, taken.absorbed, taken.escaped);
        }
        if (!STORED_IS_ALIVE && taken.stored && !fits) {
            count_on_device(tally_row(bounce), FATE_DROPPED, 1);
        }
        bounce++;
        under_way = alive && bounce < end_of_bounces();
        if (alive && !under_way) {
            leave_path(path, bounce);
        }
    }
    close_tallies();
}
