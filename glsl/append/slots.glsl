// The paper's naive store (section 2.3): photon `index` of bounce b owns slot b * N + index, stored
// or not, and keeps its thread for every bounce.

uint incoming_count(uint bounce)
{
    return counters[1];
}

bool append_survivor(uint index, Photon photon, Path path, bool alive)
{
    if (index >= incoming_count(push.bounce)) {
        return false;
    }
    uint slot = push.bounce * incoming_count(push.bounce) + index;
    bool stored = alive && slot < push.photon_capacity;
    if (!stored) {
        photon.wall = NO_WALL;
        path.wall = NO_WALL;
    }
    if (slot < push.photon_capacity) {
        store_photon(slot, photon);
    }
    store_path(index, path);
    return stored;
}
