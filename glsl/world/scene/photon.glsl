// A photon where it arrived at a surface that scatters: one entry of the map of a scene of triangles. In memory it is two
// aligned words of 16 bytes, each read and written at once; the first alone shows whether a photon is near. Twin of
// src/photon.rs.

struct Photon {
    vec3 position;
    uint plane;
    vec3 flux;
    uint wi;
};

uvec4 place_word(Photon photon)
{
    return uvec4(floatBitsToUint(photon.position), photon.plane);
}

uvec4 light_word(Photon photon)
{
    return uvec4(floatBitsToUint(photon.flux), photon.wi);
}
