// Photons from their light to their end, each in the registers of one invocation: no array of paths is read or
// written between bounces. An invocation whose photon has ended takes its next one in the same step in which its
// neighbours fly on (persistent threads, Aila and Laine 2009), so that a subgroup stays full.

void trace_persistent()
{
    open_tallies();
    uint next = invocation_index(); // photon of the range to start with, then every `stride`th
    if (next >= push.stride) {
        next = push.range.count;
    }
    bool flying = false;
    uint bounce = 0;
    Path path;
    for (;;) {
        if (!flying && next < push.range.count) {
            path = leave_light(next, push.range);
            next += push.stride;
            bounce = 0;
            flying = true;
        }
        if (subgroupBallot(flying) == uvec4(0)) {
            break;
        }
        Bounced bounced = no_bounce();
        if (flying) {
            bounced = bounce_path(path, bounce);
        }
        uint place = take_place(0, bounced.alive);
        bool stored = bounced.alive && place < push.photon_capacity;
        if (stored) {
            store_photon(place, bounced.photon);
        }
        if (flying) {
            count_fate(bounce, stored, bounced.absorbed, bounced.escaped);
        }
        bounce++;
        flying = stored && bounce < push.bounces;
    }
    close_tallies();
}
