// Moves the survivors of a bounce together, in the order of their paths, into the photon map and the outgoing paths.
// survivors[g] = survivors in the work groups before g, which are those of stages/trace_in_place.glsl.

layout(set = 1, binding = 0, scalar) readonly buffer Paths { Path paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { Path next_paths[]; };
layout(set = 1, binding = 3, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 5, scalar) readonly buffer Survivors { uint survivors[]; };
layout(set = 1, binding = 6, scalar) readonly buffer Weights { float weights[]; };

void keep_order()
{
    uint index = invocation_index();
    Path path;
    path.wall = NO_WALL;
    if (index < min(counters[1 + push.bounce], push.path_capacity)) {
        path = paths[index];
    }
    bool alive = path.wall != NO_WALL;
    GroupPrefix prefix = prefix_in_group(alive);
    bool stored = false;
    if (alive) {
        uint path_place = survivors[work_group_index()] + prefix.before;
        uint place = counters[0] + path_place;
        stored = place < push.photon_capacity;
        if (stored) {
            float weight = 1.0;
            if (HAS_PHONG) {
                weight = weights[index];
            }
            store_photon(place, Photon(path.position, path.wall, path.flux, weight, path.photon, push.bounce));
            // Those that find no room are the last, so that no gap arises.
            next_paths[path_place] = path;
        }
    }
    tally(push.bounce, stored, false, false, alive && !stored);
}
