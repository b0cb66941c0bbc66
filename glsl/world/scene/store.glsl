// The map that photons of a scene of triangles are stored in.

layout(set = 1, binding = 2, scalar) writeonly buffer Map { uvec4 map[]; };

void store(uint place, MapPhoton photon)
{
    map[2 * place] = place_word(photon);
    map[2 * place + 1] = light_word(photon);
}
