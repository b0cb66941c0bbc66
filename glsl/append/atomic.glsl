// The paper's modified store (section 3): every survivor takes the next place by an atomic of its
// own, one for the photon map and one for the outgoing paths.

uint incoming_count(uint bounce)
{
    return min(counters[1 + bounce], push.path_capacity);
}

bool append_survivor(uint index, Photon photon, Path path, bool alive)
{
    if (!alive) {
        return false;
    }
    uint photon_slot = atomicAdd(counters[0], 1);
    if (photon_slot >= push.photon_capacity) {
        return false;
    }
    // Survivors are never more than the incoming paths, so this one always fits.
    uint path_slot = atomicAdd(counters[2 + push.bounce], 1);
    photons[photon_slot] = photon;
    next_paths[path_slot] = path;
    return true;
}
