// Writes each photon of a map to its place in bucket order.
// Dispatched by src/transport/photons.rs once a chunk. One thread = one photon.
// cells[b] = first place of bucket b; ranks from map_count.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#include "records.glsl"
#include "scene/map_photon.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { CellPush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Map { PackedMapPhoton map[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Counters { uint counters[]; };
layout(set = 1, binding = 2, scalar) readonly buffer Cells { uint cells[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer SortedMap { PackedMapPhoton sorted_map[]; };
layout(set = 1, binding = 4, scalar) readonly buffer Ranks { uint ranks[]; };

#include "dispatch.glsl"
#include "scene/cells.glsl"

void main()
{
    uint index = invocation_index();
    if (index < min(counters[0], push.photon_capacity)) {
        PackedMapPhoton photon = map[index];
        uint bucket = bucket_of(cell_at(uintBitsToFloat(photon.place.xyz), push), push);
        sorted_map[cells[bucket] + ranks[index]] = photon;
    }
}
