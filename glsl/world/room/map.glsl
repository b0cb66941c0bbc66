// The photon map as a builder writes it. A photon is stored where it is reflected, so that one place serves for the photon and
// for its path.

const bool STORED_IS_ALIVE = true;

// Whether photons weigh less than 1 at the eye.
layout(constant_id = 3) const bool HAS_PHONG = false;

layout(set = 1, binding = 2, scalar) writeonly buffer Photons { uvec4 photons[]; };
// (photon, bounce) of each, where the plan keeps them.
layout(set = 1, binding = 7, scalar) writeonly buffer Origins { uvec2 origins[]; };

layout(constant_id = 37) const bool HAS_ORIGINS = false;

void store_photon(uint place, Photon photon)
{
    photons[place] = pack_photon(photon);
    if (HAS_ORIGINS) {
        origins[place] = uvec2(photon.photon, photon.bounce);
    }
}

// An entry that is none.
Photon emptied(Photon photon)
{
    photon.wall = NO_WALL;
    return photon;
}
