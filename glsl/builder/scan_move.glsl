// Moves the survivors of a bounce together, in the order of their paths, into the photon map and the outgoing paths, after the
// prefix sum over what builder/scan.glsl has counted: survivors[g] = survivors in the work groups before g.

const uint PLACES = 1;

#include "builder/group_prefix.glsl"
#include "world/WORLD/scan.glsl"

layout(set = 1, binding = 5, scalar) readonly buffer Survivors { uint survivors[]; };

void move_together()
{
    uint index = invocation_index();
    uint groups = group_count();
    bool entered = index < min(counters[1 + incoming_list()], push.path_capacity);
    bool alive = entered && has_path(index);
    GroupPrefix prefix = prefix_in_group(bool[](alive));
    uint path_place = survivors[work_group_index()] + prefix.before[0];
    bool stored = alive;
    uint photon_place;
    if (STORED_IS_ALIVE) {
        photon_place = counters[0] + path_place;
    } else {
        stored = entered && has_photon(index);
        GroupPrefix landed = prefix_in_group(bool[](stored));
        photon_place = survivors[groups + 1 + work_group_index()] - survivors[groups] + landed.before[0];
    }
    bool fits = stored && photon_place < photon_capacity();
    if (fits) {
        store_photon(photon_place, left_photon(index));
    }
    if (alive && (fits || !STORED_IS_ALIVE) && has_next_bounce()) {
        store_path(path_place, incoming_path(index));
    }
    if (index == 0) {
        counters[2 + incoming_list()] = survivors[groups];
        if (!STORED_IS_ALIVE) {
            counters[0] = survivors[2 * groups + 1] - survivors[groups];
        }
    }
    tally(tally_row(push.bounce), fates(STORED_IS_ALIVE && fits, false, false, stored && !fits));
}
