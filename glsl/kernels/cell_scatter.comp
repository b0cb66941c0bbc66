// Writes each photon to its place in cell order.
// Dispatched by src/index.rs once a chunk. One thread = one entry of the photon map.
// cells[c] = first place of cell c; ranks from cell_count.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { IndexPush push; };
#include "stages/photon_list.glsl"
layout(set = 1, binding = 2, scalar) readonly buffer Cells { uint cells[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer SortedPhotons { SortedPhoton sorted_photons[]; };
layout(set = 1, binding = 4, scalar) readonly buffer Ranks { uint ranks[]; };

#include "dispatch.glsl"
#include "grid.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= photon_list_length(push.photon_capacity)) {
        return;
    }
    Photon photon = photons[index];
    if (photon.wall == NO_WALL) {
        return;
    }
    uvec3 cell = cell_of(photon.position, push.origin, push.cells_per_metre, push.cell_count);
    uint place = cells[cell_number(cell, push.cell_count)] + ranks[index];
    sorted_photons[place] = SortedPhoton(photon.position, photon.wall, photon.flux, photon.weight);
}
