// Density estimation over the sorted grid: each point tests the photons of the cells in reach. A
// point's candidates are shared out in slices of GATHER_SLICE, so that no invocation loops long.

layout(set = 1, binding = 2, scalar) readonly buffer SortedPhotons { SortedPhoton sorted_photons[]; };

void gather()
{
    uint index = push.first_point + gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (index >= push.end_point) {
        return;
    }
    Point point = points[index];
    CellBox box = cells_in_reach(point.position);
    uint slice_begin = (push.first_slice + gl_WorkGroupID.y) * GATHER_SLICE;
    uint slice_end = slice_begin + GATHER_SLICE;

    Gathered gathered = nothing_gathered();
    uint passed = 0; // candidates in the rows before this one
    for (uint z = box.first.z; z <= box.last.z; z++) {
        for (uint y = box.first.y; y <= box.last.y; y++) {
            uvec2 run = row_run(box, y, z);
            uint run_length = run.y - run.x;
            uint begin = run.x + clamp(slice_begin, passed, passed + run_length) - passed;
            uint end = run.x + clamp(slice_end, passed, passed + run_length) - passed;
            for (uint i = begin; i < end; i++) {
                if (within_radius(point, sorted_photons[i].position, sorted_photons[i].wall)) {
                    gather_photon(gathered, sorted_photons[i].flux, sorted_photons[i].weight);
                }
            }
            passed += run_length;
        }
    }
    add_gathered(index, gathered);
}
