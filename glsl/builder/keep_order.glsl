// Moves the survivors of a bounce together, in the order of their paths, into the photon map and the outgoing paths.
// survivors[g] = survivors in the work groups before g, which are those of builder/trace_in_place.glsl; behind the last
// group stands the number of all.

layout(set = 1, binding = 3, scalar) buffer Counters { uint counters[]; };
layout(set = 1, binding = 5, scalar) readonly buffer Survivors { uint survivors[]; };
layout(set = 1, binding = 6, scalar) readonly buffer Weights { float weights[]; };

void keep_order()
{
    uint index = invocation_index();
    bool alive = index < min(counters[1 + push.bounce], push.path_capacity) && has_path(index);
    GroupPrefix prefix = prefix_in_group(bool[](alive));
    bool stored = false;
    if (alive) {
        uint path_place = survivors[work_group_index()] + prefix.before[0];
        uint place = counters[0] + path_place;
        stored = place < push.photon_capacity;
        if (stored) {
            Path path = incoming_path(index);
            float weight = 1.0;
            if (HAS_PHONG) {
                weight = weights[index];
            }
            store_photon(place, Photon(path.position, path.wall, path.flux, weight, path.photon, push.bounce));
            if (has_next_bounce()) {
                store_path(path_place, path);
            }
        }
    }
    if (index == 0) {
        uint group_count = (push.path_capacity + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x;
        counters[2 + push.bounce] = survivors[group_count];
    }
    tally(push.bounce, fates(stored, false, false, alive && !stored));
}
