// Survivors only, side by side, as many photons as paths, so that one place serves for both; atomic.glsl, ballot.glsl and
// group.glsl each define
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
    uint path_place = take_place(2 + push.bounce, alive);
    // The photons of earlier bounces come first; kernels/end_bounce.comp counts this one's once all are there.
    uint photon_place = counters[0] + path_place;
    bool stored = alive && photon_place < push.photon_capacity;
    if (stored) {
        store_photon(photon_place, photon);
        // Survivors are never more than the incoming paths, so this one always fits.
        store_path(path_place, path);
    }
    return stored;
}
