// The longest candidate list of any visible point, which decides how many slices a lookup needs.
// Dispatched by src/transport/points.rs once a map and chunk. One thread = one point.
// After it longest[0] = candidates of the busiest point.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { LookupPush push; };
layout(set = 0, binding = 0, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 0, scalar) buffer Longest { uint longest[]; };

#include "dispatch.glsl"
#include "scene/cells.glsl"
#include "stages/map_rows.glsl"

void main()
{
    uint index = push.first_point + invocation_index();
    uint candidate_count = 0;
    if (index < push.end_point && visible_points[index].arrivals != 0) {
        CellRange range = cells_near(visible_points[index].position);
        for (int z = range.first.z; z <= range.last.z; z++) {
            for (int y = range.first.y; y <= range.last.y; y++) {
                candidate_count += row_of_photons(range, ivec2(y, z)).y;
            }
        }
    }
    uint longest_here = subgroupMax(candidate_count);
    if (subgroupElect()) {
        atomicMax(longest[0], longest_here);
    }
}
