// The longest candidate list of any point, which decides how many slices the grid gather needs.
// Dispatched by src/engine/room/estimate.rs once a chunk. One thread = one point.
// After it longest[0] = candidates of the busiest point.
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_EXT_scalar_block_layout : require

#include "gather/points.glsl"

layout(push_constant, scalar) uniform Push { GatherPush push; };
layout(set = 0, binding = 3, scalar) readonly buffer Points { Point points[]; };
layout(set = 1, binding = 0, scalar) buffer Longest { uint longest[]; };

#include "dispatch/dispatch.glsl"
#include "index/grid.glsl"
#include "gather/grid_rows.glsl"

void main()
{
    uint index = invocation_index();
    uint candidate_count = 0;
    if (index < push.end_point) {
        CellBox box = cells_in_reach(points[index]);
        for (uint z = box.first.z; z <= box.last.z; z++) {
            for (uint y = box.first.y; y <= box.last.y; y++) {
                uvec2 run = row_run(box, y, z);
                candidate_count += run.y - run.x;
            }
        }
    }
    uint longest_here = subgroupMax(candidate_count);
    if (subgroupElect()) {
        atomicMax(longest[0], longest_here);
    }
}
