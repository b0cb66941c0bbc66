// One bounce of every path by the paper's naive builder (section 2.3): photon `index` of bounce b owns slot b * N + index,
// stored or not, and keeps its thread for every bounce.

layout(set = 1, binding = 3, scalar) readonly buffer Counters { uint counters[]; };

void trace_slots()
{
    uint index = invocation_index();
    uint photon_count = counters[1];
    Bounced bounced = no_bounce();
    bool stored = false;
    if (index < photon_count) {
        Path path = incoming_path(index);
        if (path.wall != NO_WALL) {
            bounced = bounce_path(path, push.bounce);
        }
        uint slot = push.bounce * photon_count + index;
        stored = bounced.alive && slot < push.photon_capacity;
        Photon photon = bounced.photon;
        if (!stored) {
            photon.wall = NO_WALL;
            path.wall = NO_WALL;
        }
        if (slot < push.photon_capacity) {
            store_photon(slot, photon);
        }
        if (has_next_bounce()) {
            store_path(index, path);
        }
    }
    tally(push.bounce, fates(stored, bounced.absorbed, bounced.escaped, bounced.alive && !stored));
}
