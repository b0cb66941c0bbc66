// Photons as the photon map and its indices hold them: 16 bytes each, moved as one word of four. Twin of src/photon.rs.
//
// A photon lies in the plane of its wall to the bit (world/room/geometry.glsl sets that coordinate), so its other two coordinates and the
// wall say where: x and y are those along the two axes after the wall's own, cyclically. Flux and weight lie in [0, 1], so
// their bits leave room for the wall: its axis in the upper two of z, beside the flux, its side in the uppermost of w,
// beside the weight. Axis 3 is no wall: an empty slot.

#include "world/room/walls.glsl"

struct Photon {
    vec3 position;
    uint wall;
    float flux;
    float weight;
    uint photon;
    uint bounce;
};

// Coordinates of a place on a wall of that axis.
vec2 along_wall(vec3 position, uint axis)
{
    return axis == 0 ? position.yz : (axis == 1 ? position.zx : position.xy);
}

uvec4 pack_photon(Photon photon)
{
    uint axis = (photon.wall >> 1) & 3u; // NO_WALL has all bits set
    uvec2 place = floatBitsToUint(along_wall(photon.position, axis));
    return uvec4(place, (floatBitsToUint(photon.flux) & 0x3fffffffu) | axis << 30,
                 (floatBitsToUint(photon.weight) & 0x7fffffffu) | photon.wall << 31);
}

bool is_empty(uvec4 stored)
{
    return stored.z >> 30 == 3u;
}

// FACE_COUNT or more in an empty slot.
uint wall_of(uvec4 stored)
{
    return stored.z >> 30 << 1 | stored.w >> 31;
}

vec2 place_of(uvec4 stored)
{
    return uintBitsToFloat(stored.xy);
}

float flux_of(uvec4 stored)
{
    return uintBitsToFloat(stored.z & 0x3fffffffu);
}

float weight_of(uvec4 stored)
{
    return uintBitsToFloat(stored.w & 0x7fffffffu);
}

// Between a place on the photon's wall and the photon. Across the wall they do not differ, so that all three coordinates
// would give the same bits.
float squared_distance(vec2 place, uvec4 stored)
{
    precise vec2 offset = place_of(stored) - place;
    precise float distance_squared = offset.x * offset.x + offset.y * offset.y;
    return distance_squared;
}

vec3 position_of(uvec4 stored, Room room)
{
    uint axis = stored.z >> 30;
    vec2 place = place_of(stored);
    vec3 corner = stored.w >> 31 == 1u ? room.max_corner : room.min_corner;
    return axis == 0 ? vec3(corner.x, place) : (axis == 1 ? vec3(place.y, corner.y, place.x) : vec3(place, corner.z));
}
