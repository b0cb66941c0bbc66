// One bounce of every path, which stays where it is: the dead leave gaps, and each work group counts its survivors. After a prefix
// sum over these counts builder/scan_move.glsl moves the survivors together, so that photons keep their order.
//
// survivors[g] = paths of work group g that go on. Where photons have places of their own (STORED_IS_ALIVE is false) there
// follow, behind those of all groups, the length of the map so far, and then the photons that each group stores.

const uint PLACES = 1;

#include "builder/group_prefix.glsl"
#include "world/WORLD/scan.glsl"

layout(set = 1, binding = 5, scalar) writeonly buffer Survivors { uint survivors[]; };

void trace()
{
    uint index = invocation_index();
    bool entered = index < min(counters[1 + incoming_list()], push.path_capacity);
    Step taken = no_step();
    bool goes_on = false;
    if (entered) {
        PhotonState path = incoming_path(index);
        taken = step_path(path, push.bounce);
        goes_on = taken.alive && (STORED_IS_ALIVE || has_next_bounce());
        if (goes_on) {
            store_path(index, path);
        } else {
            store_no_path(index);
        }
        if (taken.alive && !goes_on) {
            cut_off(path);
        }
        leave_photon(index, taken.stored, taken.photon);
    }
    GroupPrefix prefix = prefix_in_group(bool[](goes_on));
    // The last row of groups may be longer than the paths.
    if (gl_LocalInvocationIndex == 0 && entered) {
        survivors[work_group_index()] = prefix.total;
    }
    if (!STORED_IS_ALIVE) {
        GroupPrefix landed = prefix_in_group(bool[](taken.stored));
        if (gl_LocalInvocationIndex == 0 && entered) {
            survivors[group_count() + 1 + work_group_index()] = landed.total;
        }
        if (index == 0) {
            survivors[group_count()] = counters[0];
        }
    }
    tally(tally_row(push.bounce), fates(!STORED_IS_ALIVE && taken.alive, taken.absorbed, taken.escaped, false));
}
