// The room's photons and paths, packed and unpacked.
// Dispatched by tests/engine/packing.rs. One thread = one case, which stands beside what Rust packed of it.
#extension GL_EXT_scalar_block_layout : require

#include "check/packing_case.glsl"

// An entry of the room's photon map and a path, unpacked.
struct UnpackedRoom {
    vec3 place;
    uint wall;
    float flux;
    float weight;
    vec3 position;
    uint path_wall;
    vec3 direction;
    uint photon;
    uvec2 stream;
    float path_flux;
};

layout(set = 1, binding = 0, scalar) readonly buffer Cases { PackingCase cases[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Photons { uvec4 photons[]; };
layout(set = 1, binding = 2, scalar) readonly buffer Paths { uvec4 paths[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer SortedPhotons { uvec4 sorted_photons[]; };
layout(set = 1, binding = 4, scalar) writeonly buffer NextPaths { uvec4 next_paths[]; };
layout(set = 1, binding = 5, scalar) writeonly buffer Results { UnpackedRoom results[]; };

#include "dispatch/dispatch.glsl"
#include "world/room/photon.glsl"
#include "world/room/photon_state.glsl"

void main()
{
    uint index = invocation_index();
    uint count = cases.length();
    if (index >= count) {
        return;
    }
    PackingCase at = cases[index];
    sorted_photons[index] = pack_photon(Photon(at.position, at.wall, at.flux, at.weight, 0, 0));
    uvec4 words[PATH_WORDS] = pack_path(PhotonState(at.position, at.wall, at.direction, at.photon, at.stream, at.flux));
    for (uint k = 0; k < PATH_WORDS; k++) {
        next_paths[path_word(k, index, count)] = words[k];
        words[k] = paths[path_word(k, index, count)];
    }
    uvec4 stored = photons[index];
    PhotonState path = unpack_path(words);
    results[index] = UnpackedRoom(position_of(stored, at.room), is_empty(stored) ? NO_WALL : wall_of(stored), flux_of(stored),
                                  weight_of(stored), path.position, path.wall, path.direction, path.photon, path.stream, path.flux);
}
