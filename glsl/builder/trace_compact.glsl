// One bounce of every path, survivors only stored, side by side, as many photons as paths, so that one place serves for both.
// An invocation takes `PLACES` paths through it: a device adds only so often a second to one counter, and more of them share
// an addition. builder/each.glsl, builder/block.glsl and builder/group.glsl each define
//
//   uint[PLACES] take_places(uint counter, bool[PLACES] wanted)
//       called by all invocations of a work group together; the next free places that `counter` counts, where one is
//       wanted.
//
// counters[0] is the length of the photon map, counters[1 + k] the number of paths entering bounce k.
// Counters run on when the map is full: readers take the smaller of counter and capacity.

void trace_compact()
{
    uint path_count = min(counters[1 + push.bounce], push.path_capacity);
    uint row = (path_count + PLACES - 1) / PLACES;
    uint column = invocation_index();
    Path[PLACES] path;
    Bounced[PLACES] bounced;
    bool[PLACES] alive;
    [[unroll]] for (uint k = 0; k < PLACES; k++) {
        uint index = k * row + column;
        bounced[k] = no_bounce();
        if (column < row && index < path_count) {
            path[k] = incoming_path(index);
            // Gaps of several counters; nobody else leaves any.
            if (path[k].wall != NO_WALL) {
                bounced[k] = bounce_path(path[k], push.bounce);
            }
        }
        alive[k] = bounced[k].alive;
    }
    uint[PLACES] places = take_places(2 + push.bounce, alive);
    uvec4 counts = uvec4(0);
    [[unroll]] for (uint k = 0; k < PLACES; k++) {
        // The photons of earlier bounces come first.
        uint photon_place = counters[0] + places[k];
        bool stored = alive[k] && photon_place < push.photon_capacity;
        if (stored) {
            store_photon(photon_place, bounced[k].photon);
            // Places are never more than the incoming paths, up to a whole work group, so this one always fits.
            if (has_next_bounce()) {
                store_path(places[k], path[k]);
            }
        }
        counts += fates(stored, bounced[k].absorbed, bounced[k].escaped, alive[k] && !stored);
    }
    tally(push.bounce, counts);
}
