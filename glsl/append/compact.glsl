// Survivors only, side by side; atomic.glsl, ballot.glsl and group.glsl each define
//
//   uint take_place(uint counter, bool wanted)
//       called by all invocations of a work group together, or with atomic.glsl and ballot.glsl by those of a subgroup
//       that are there (stages/trace_whole.glsl); the next free place that `counter`
//       counts, for those that want one.

uint incoming_count(uint bounce)
{
    return min(counters[1 + bounce], push.path_capacity);
}

bool append_survivor(uint index, Photon photon, Path path, bool alive)
{
    uint photon_slot = take_place(0, alive);
    bool stored = alive && photon_slot < push.photon_capacity;
    // Survivors are never more than the incoming paths, so this one always fits.
    uint path_slot = take_place(2 + push.bounce, stored);
    if (stored) {
        store_photon(photon_slot, photon);
        next_paths[path_slot] = path;
    }
    return stored;
}
