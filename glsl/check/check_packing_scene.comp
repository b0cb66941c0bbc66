// Photons of scenes of triangles, normals and directions, boxes of a node and the bits of one hit, packed and unpacked.
// Dispatched by tests/engine/packing.rs. One thread = one case, which stands beside what Rust packed of it.
#extension GL_EXT_scalar_block_layout : require

#include "check/packing_case.glsl"

// An entry of the map of a scene of triangles, unit vectors packed and unpacked, and a child of a node.
struct UnpackedScene {
    vec3 position;
    uint plane;
    vec3 flux;
    uint wi;
    uint normal_code;
    vec3 normal;
    uint direction_code;
    vec3 low;
    vec3 high;
    uint meta;
    uint child_nodes;
};

layout(set = 1, binding = 0, scalar) readonly buffer Cases { PackingCase cases[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Map { uvec4 map[]; };
layout(set = 1, binding = 4, scalar) writeonly buffer SortedMap { uvec4 sorted_map[]; };
layout(set = 1, binding = 5, scalar) writeonly buffer Results { UnpackedScene results[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "math/directions.glsl"
#include "world/scene/photon.glsl"
#include "world/scene/bvh_node.glsl"
#include "world/scene/single_hit.glsl"

layout(set = 1, binding = 2, scalar) readonly buffer NodeCases { BvhNode node_cases[]; };

void main()
{
    uint index = invocation_index();
    if (index >= cases.length()) {
        return;
    }
    PackingCase at = cases[index];
    Photon photon = Photon(at.position, at.photon, at.colour, at.stream.x);
    sorted_map[2 * index] = place_word(photon);
    sorted_map[2 * index + 1] = light_word(photon);
    uvec4 place = map[2 * index];
    uvec4 light = map[2 * index + 1];
    BvhNode node = node_cases[index];
    uint child = index & 7u;
    results[index] = UnpackedScene(uintBitsToFloat(place.xyz), place.w, uintBitsToFloat(light.xyz), light.w, pack_normal(at.direction),
                                   unpack_normal(at.normal_code), pack_direction(at.direction, index & 3u), low_corner(node, child),
                                   high_corner(node, child), byte_of(node.meta, child), child_nodes_of(node));

    note_miss(index, 0, at.colour);
    note_miss(index, 0, 0.5 * at.colour);
    note_miss(index, 1, at.colour);
    note_hit(index, 1);
}
