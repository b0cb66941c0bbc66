// Photons in flight, and their paths between bounces as three words of four: place, direction and random stream. The first
// words of all paths stand side by side, then the second and the third ones, so that neighbouring invocations move
// neighbouring words. Twin of src/photon_state.rs.

struct PhotonState {
    vec3 position;
    uint wall; // NO_WALL once it has died where it stands
    vec3 direction;
    uint photon;
    uvec2 stream;
    float flux;
};

const uint PATH_WORDS = 3;

// Where word k of path `index` stands in an array with room for `capacity` paths.
uint path_word(uint k, uint index, uint capacity)
{
    return k * capacity + index;
}

uvec4[PATH_WORDS] pack_path(PhotonState path)
{
    return uvec4[](uvec4(floatBitsToUint(path.position), path.wall), uvec4(floatBitsToUint(path.direction), path.photon),
                   uvec4(path.stream, floatBitsToUint(path.flux), 0));
}

PhotonState unpack_path(uvec4[PATH_WORDS] words)
{
    return PhotonState(uintBitsToFloat(words[0].xyz), words[0].w, uintBitsToFloat(words[1].xyz), words[1].w, words[2].xy,
                uintBitsToFloat(words[2].z));
}
