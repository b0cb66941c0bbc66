// One flight of every photon, stored where it lands. The including kernel chose how places are taken.
// counters[1 + push.list] = paths that enter, counters[2 + push.list] = those that go on.

layout(set = 1, binding = 0, scalar) readonly buffer LightPaths { LightPath light_paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextLightPaths { LightPath next_light_paths[]; };

void scene_trace()
{
    uint index = invocation_index();
    Traced traced = no_flight();
    LightPath path;
    if (index < min(counters[1 + push.list], push.path_capacity)) {
        path = light_paths[index];
        traced = trace_flight(path, push.bounce);
    }
    bool goes_on = traced.alive;
    if (push.is_last != 0) {
        goes_on = false;
        if (traced.alive) {
            count_loss(TOTAL_CUT_OFF, path.flux);
        }
    }
    // Full maps drop nothing: the plan gives room for every photon at every bounce.
    uint place = take_place(0, traced.stored);
    bool dropped = traced.stored && place >= push.map.photon_capacity;
    if (traced.stored && !dropped) {
        store(place, traced.photon);
    }
    uint path_place = take_place(2 + push.list, goes_on);
    if (goes_on) {
        next_light_paths[path_place] = path;
    }
    uint row = min(push.bounce, TALLY_ROWS - 1);
    tally(row, fates(traced.alive, traced.absorbed, traced.escaped, false));
    if (dropped) {
        atomicAdd(tallies[tally_copy(row)].dropped, 1);
    }
}
