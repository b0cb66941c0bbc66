// Counts the photons of each grid cell, and numbers them in it.
// Dispatched by src/engine/room/index.rs once a chunk. One thread = one entry of the photon map.
// After it cells[c] = photons in cell c; ranks[i] = photons that came to the cell of entry i before it. That order
// varies from run to run; the integer sums of the film do not see it.
#extension GL_EXT_scalar_block_layout : require

#include "world/room/walls.glsl"
#include "index/push.glsl"

layout(push_constant, scalar) uniform Push { IndexPush push; };
layout(set = 0, binding = 0, scalar) readonly buffer Rooms { Room rooms[]; };
#include "index/photon_list.glsl"
layout(set = 1, binding = 2, scalar) buffer Cells { uint cells[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer Ranks { uint ranks[]; };

#include "dispatch/dispatch.glsl"
#include "world/room/photon.glsl"
#include "index/grid.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= photon_list_length(push.photon_capacity)) {
        return;
    }
    uvec4 photon = photons[index];
    if (is_empty(photon)) {
        return;
    }
    uvec3 cell = cell_of(position_of(photon, rooms[0]), push.origin, push.cells_per_metre, push.cell_count);
    ranks[index] = atomicAdd(cells[cell_number(cell, push.cell_count)], 1);
}
