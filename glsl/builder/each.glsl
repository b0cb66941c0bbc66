// A place for each survivor by itself.

uint[PLACES] take_places(uint counter, bool[PLACES] wanted)
{
    uint[PLACES] places;
    for (uint k = 0; k < PLACES; k++) {
        places[k] = take_place(counter, wanted[k]);
    }
    return places;
}
