// A photon of a map as memory holds it: two aligned words of 16 bytes, each read and written at once. A candidate is
// told by the first alone.

struct PackedMapPhoton {
    uvec4 place;
    uvec4 light;
};

PackedMapPhoton pack(MapPhoton photon)
{
    return PackedMapPhoton(uvec4(floatBitsToUint(photon.position), photon.normal), uvec4(floatBitsToUint(photon.flux), photon.wi));
}
