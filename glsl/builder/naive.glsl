// The paper's naive builder (section 2.3), `--variant naive`: one bounce of every path. A photon has a slot of its own for each bounce,
// stored or not (one slot in a caustic map), and keeps its thread for every bounce.

void trace()
{
    uint index = invocation_index();
    uint photon_count = counters[1];
    Step taken = no_step();
    bool fits = false;
    bool goes_on = false;
    if (index < photon_count) {
        PhotonState path = incoming_path(index);
        if (is_path(path)) {
            taken = step_path(path, push.bounce);
        }
        uint slot = slot_of(index, photon_count);
        bool is_there = slot < photon_capacity();
        fits = taken.stored && is_there;
        // Every neighbour stores, as memory takes whole lines sooner than parts of them.
        Photon photon = taken.photon;
        if (!fits) {
            photon = emptied(photon);
        }
        if (is_there && (fits || clears_slot())) {
            store_photon(slot, photon);
        }
        goes_on = taken.alive && (fits || !STORED_IS_ALIVE) && has_next_bounce();
        if (taken.alive && !goes_on) {
            cut_off(path);
        }
        if (!goes_on) {
            path = emptied(path);
        }
        if (has_next_bounce()) {
            store_path(index, path);
        }
    }
    count_left(goes_on);
    tally(tally_row(push.bounce), fates(STORED_IS_ALIVE ? fits : taken.alive, taken.absorbed, taken.escaped, taken.stored && !fits));
}
