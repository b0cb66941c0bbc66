// The photon map as a builder writes it. A photon is stored where it arrives, whatever becomes of its path there, so that the map
// and the paths that go on each have places of their own.

const bool STORED_IS_ALIVE = false;

layout(set = 1, binding = 2, scalar) writeonly buffer Map { uvec4 map[]; };

void store_photon(uint place, Photon photon)
{
    map[2 * place] = place_word(photon);
    map[2 * place + 1] = light_word(photon);
}

// An entry that is none.
Photon emptied(Photon photon)
{
    photon.plane = NONE;
    return photon;
}
