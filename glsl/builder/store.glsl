// The photon map as a builder writes it.

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
