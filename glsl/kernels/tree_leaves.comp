// Writes each photon to its place in the leaves of the kd-tree.
// Dispatched by src/engine/room/index/tree.rs once a chunk. One thread = one photon of a leaf.
#extension GL_EXT_scalar_block_layout : require

layout(set = 1, binding = 0, scalar) readonly buffer Photons { uvec4 photons[]; };
layout(set = 1, binding = 1, scalar) readonly buffer WallBegins { uint wall_begins[]; };
layout(set = 1, binding = 2, scalar) readonly buffer Keys { uvec2 keys[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer TreePhotons { uvec4 tree_photons[]; };
layout(set = 1, binding = 4, scalar) readonly buffer Origins { uvec2 origins[]; };
layout(set = 1, binding = 5, scalar) writeonly buffer TreeOrigins { uvec2 tree_origins[]; };

layout(constant_id = 37) const bool HAS_ORIGINS = false;

#include "dispatch/dispatch.glsl"

void main()
{
    uint place = invocation_index();
    if (place < wall_begins[FACE_COUNT]) {
        uint entry = keys[place].y;
        tree_photons[place] = photons[entry];
        if (HAS_ORIGINS) {
            tree_origins[place] = origins[entry];
        }
    }
}
