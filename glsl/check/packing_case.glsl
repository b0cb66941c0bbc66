#include "world/room/walls.glsl"

// What `glsl/check/check_packing_...` pack.
struct PackingCase {
    // In the plane of its wall, where it has one.
    vec3 position;
    uint wall;
    // A unit vector.
    vec3 direction;
    uint photon;
    uvec2 stream;
    float flux;
    float weight;
    // Flux of a map's photon, and what one hit adds.
    vec3 colour;
    // Of a normal that is only unpacked.
    uint normal_code;
    Room room;
};
