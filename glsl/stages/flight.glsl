// One flight of every photon, stored where it lands. The including kernel chose how places are taken.

layout(set = 1, binding = 0, scalar) readonly buffer LightPaths { LightPath light_paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextLightPaths { LightPath next_light_paths[]; };

void fly()
{
    uint index = invocation_index();
    Flown flown = no_flight();
    LightPath path;
    if (index < min(counters[1 + push.bounce], push.path_capacity)) {
        path = light_paths[index];
        flown = fly_once(path, push.bounce);
    }
    // Full maps drop nothing: the plan gives room for every photon at every bounce.
    uint place = take_place(0, flown.stored);
    bool dropped = flown.stored && place >= push.map.photon_capacity;
    if (flown.stored && !dropped) {
        store(place, flown.photon);
    }
    uint path_place = take_place(2 + push.bounce, flown.alive);
    if (flown.alive) {
        next_light_paths[path_place] = path;
    }
    tally(push.bounce, fates(flown.alive, flown.absorbed, flown.escaped, false));
    if (dropped) {
        atomicAdd(tallies[tally_copy(push.bounce)].dropped, 1);
    }
}
