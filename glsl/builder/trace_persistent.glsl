// Photons from their light to their end, each in the registers of one invocation: no array of paths is read or
// written between bounces. An invocation whose photon has ended takes its next one in the same step in which its
// neighbours go on (persistent threads, Aila and Laine 2009), so that a subgroup stays full.

void trace_persistent()
{
    open_tallies();
    uint next = invocation_index(); // photon of the range to start with, then every `stride`th
    if (next >= push.stride) {
        next = push.range.count;
    }
    bool under_way = false;
    uint bounce = 0;
    Path path;
    for (;;) {
        if (!under_way && next < push.range.count) {
            path = leave_light(next, push.range);
            next += push.stride;
            bounce = 0;
            under_way = true;
        }
        if (subgroupBallot(under_way) == uvec4(0)) {
            break;
        }
        Bounced bounced = no_bounce();
        if (under_way) {
            bounced = bounce_path(path, bounce);
        }
        uint place = take_place(0, bounced.alive);
        bool stored = bounced.alive && place < push.photon_capacity;
        if (stored) {
            store_photon(place, bounced.photon);
        }
        if (under_way) {
            count_fate(bounce, stored, bounced.absorbed, bounced.escaped);
        }
        bounce++;
        under_way = stored && bounce < push.bounces;
    }
    close_tallies();
}
