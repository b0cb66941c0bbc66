// Density estimation over the sorted grid: each point tests the photons of the cells in reach. LANES neighbouring
// invocations share a point and step through its candidates together, so that their reads are one. Where loops must
// end early, candidates are shared out in slices of GATHER_SLICE too.

#include "index/grid.glsl"
#include "gather/grid_rows.glsl"
#include "gather/estimate.glsl"

layout(set = 1, binding = 2, scalar) readonly buffer SortedPhotons { uvec4 sorted_photons[]; };

layout(constant_id = 38) const uint LANES = 1;
layout(constant_id = 39) const bool HAS_SLICES = true;

void gather()
{
    uint invocation = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    uint index = push.first_point + invocation / LANES;
    uint lane = invocation % LANES;
    if (index >= push.end_point) {
        return;
    }
    Point point = points[index];
    CellBox box = cells_in_reach(point);
    Site site = site_of(point);
    uint slice_begin = gl_WorkGroupID.y * GATHER_SLICE;
    uint slice_end = HAS_SLICES ? slice_begin + GATHER_SLICE : NONE;

    Gathered gathered = nothing_gathered();
    uint passed = 0; // candidates in the rows before this one
    for (uint z = box.first.z; z <= box.last.z; z++) {
        for (uint y = box.first.y; y <= box.last.y; y++) {
            uvec2 run = row_run(box, y, z);
            uint run_length = run.y - run.x;
            uint begin = run.x + clamp(slice_begin, passed, passed + run_length) - passed;
            uint end = run.x + clamp(slice_end, passed, passed + run_length) - passed;
            for (uint i = begin + lane; i < end; i += LANES) {
                uvec4 photon = sorted_photons[i];
                if (within_radius(site, photon)) {
                    gather_photon(gathered, photon);
                }
            }
            passed += run_length;
        }
    }
    add_gathered(index, gathered);
}
