// Survivors only, side by side, as many photons as paths, so that one place serves for both; atomic.glsl, ballot.glsl and
// group.glsl each define
//
//   uint take_place(uint counter, bool wanted)
//       called by all invocations of a work group together, or with atomic.glsl and ballot.glsl by those of a subgroup
//       that are there (stages/trace_whole.glsl); the next free place that `counter`
//       counts, for those that want one.

// Apart from the counters, so that what every invocation reads lies in no cache line that atomics change: photons that the
// bounces before this one stored, and paths that enter it.
layout(set = 1, binding = 8, scalar) readonly buffer Progress { uint progress[]; };

uint incoming_count(uint bounce)
{
    return progress[1];
}

bool append_survivor(uint index, Photon photon, Path path, bool alive)
{
    uint path_place = take_place(2 + push.bounce, alive);
    uint photon_place = progress[0] + path_place;
    bool stored = alive && photon_place < push.photon_capacity;
    if (stored) {
        store_photon(photon_place, photon);
        // Survivors are never more than the incoming paths, so this one always fits.
        store_path(path_place, path);
    }
    return stored;
}
