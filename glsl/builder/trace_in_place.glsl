// One bounce of every path, which stays where it is: the dead leave gaps, and each work group counts its survivors.
// After a prefix sum over these counts builder/keep_order.glsl moves the survivors together.

layout(set = 1, binding = 6, scalar) writeonly buffer Weights { float weights[]; };
layout(set = 1, binding = 3, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 5, scalar) writeonly buffer Survivors { uint survivors[]; };

void trace_in_place()
{
    uint index = invocation_index();
    bool entered = index < min(counters[1 + push.bounce], push.path_capacity);
    Bounced bounced = no_bounce();
    if (entered) {
        Path path = incoming_path(index);
        bounced = bounce_path(path, push.bounce);
        if (bounced.alive) {
            store_path(index, path);
        } else {
            store_dead_path(index);
        }
        // All else of a photon is in its path.
        if (HAS_PHONG) {
            weights[index] = bounced.photon.weight;
        }
    }
    GroupPrefix prefix = prefix_in_group(bool[](bounced.alive));
    // The last row of groups may be longer than the paths.
    if (gl_LocalInvocationIndex == 0 && entered) {
        survivors[work_group_index()] = prefix.total;
    }
    tally(push.bounce, fates(false, bounced.absorbed, bounced.escaped, false));
}
