// Photons in the registers of one invocation, which takes its next one when one ends; see builder/trace_persistent.glsl. They come
// from their lights, or from the list of those that an earlier dispatch left under way. Those that are still under way after
// push.flights flights go to the next list; after push.bounces bounces in all they are cut off.

layout(set = 1, binding = 0, scalar) readonly buffer LightPaths { LightPath light_paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextLightPaths { LightPath next_light_paths[]; };

void scene_trace_persistent()
{
    open_tallies();
    uint next = invocation_index(); // photon of the dispatch to start with, then every `stride`th
    if (next >= push.stride) {
        next = push.emission.photon_count;
    }
    bool under_way = false;
    uint flights = 0; // of the photon in this dispatch
    LightPath path;
    for (;;) {
        if (!under_way && next < push.emission.photon_count) {
            if (push.first_bounce == 0) {
                path = emit_photon(push.emission.first_photon + next, push.draws, push.emission);
            } else {
                path = light_paths[push.emission.first_photon + next];
            }
            next += push.stride;
            flights = 0;
            under_way = true;
        }
        if (subgroupBallot(under_way) == uvec4(0)) {
            break;
        }
        Traced traced = no_flight();
        uint bounce = push.first_bounce + flights;
        if (under_way) {
            traced = trace_flight(path, bounce);
        }
        uint place = take_place(0, traced.stored);
        bool dropped = traced.stored && place >= push.map.photon_capacity;
        if (traced.stored && !dropped) {
            store(place, traced.photon);
        }
        uint row = min(bounce, TALLY_ROWS - 1);
        if (under_way) {
            count_fate(row, traced.alive, traced.absorbed, traced.escaped);
        }
        if (dropped) {
            count_on_device(row, FATE_DROPPED, 1);
        }
        flights++;
        under_way = traced.alive && flights < push.flights;
        if (traced.alive && !under_way) {
            if (bounce + 1 < push.bounces) {
                next_light_paths[atomicAdd(counters[1], 1)] = path;
            } else {
                count_loss(TOTAL_CUT_OFF, path.flux);
            }
        }
    }
    close_tallies();
}
