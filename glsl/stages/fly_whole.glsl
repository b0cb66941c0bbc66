// Photons from their light to their end, each in the registers of one invocation, which then takes its next one; see
// stages/trace_whole.glsl.

void fly_whole()
{
    open_tallies();
    uint next = invocation_index(); // photon of the chunk to start with, then every `stride`th
    if (next >= push.stride) {
        next = push.emission.photon_count;
    }
    bool flying = false;
    uint bounce = 0;
    LightPath path;
    for (;;) {
        if (!flying && next < push.emission.photon_count) {
            path = shine(push.emission.first_photon + next, push.draws, push.emission);
            next += push.stride;
            bounce = 0;
            flying = true;
        }
        if (subgroupBallot(flying) == uvec4(0)) {
            break;
        }
        Flown flown = no_flight();
        if (flying) {
            flown = fly_once(path, bounce);
        }
        uint place = take_place(0, flown.stored);
        bool dropped = flown.stored && place >= push.map.photon_capacity;
        if (flown.stored && !dropped) {
            store(place, flown.photon);
        }
        if (flying) {
            count_fate(bounce, flown.alive, flown.absorbed, flown.escaped);
        }
        if (dropped) {
            count_on_device(bounce, FATE_DROPPED, 1);
        }
        bounce++;
        flying = flown.alive && bounce < push.bounces;
    }
    close_tallies();
}
