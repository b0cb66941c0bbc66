// What builder/scan.glsl leaves for builder/scan_move.glsl beside the path: where it arrived, as the map holds it.

layout(set = 1, binding = 6, scalar) buffer Landed { uvec4 landed[]; };

void leave_photon(uint index, bool stored, Photon photon)
{
    if (stored) {
        landed[2 * index] = place_word(photon);
        landed[2 * index + 1] = light_word(photon);
    } else {
        landed[2 * index].w = NONE;
    }
}

bool has_photon(uint index)
{
    return landed[2 * index].w != NONE;
}

Photon left_photon(uint index)
{
    uvec4 place = landed[2 * index];
    uvec4 light = landed[2 * index + 1];
    return Photon(uintBitsToFloat(place.xyz), place.w, uintBitsToFloat(light.xyz), light.w);
}
