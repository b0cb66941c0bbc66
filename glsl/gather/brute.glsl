// The paper's rendering pass: every point steps through the photon list, empty slots and all.

#include "gather/estimate.glsl"

layout(set = 1, binding = 1, scalar) readonly buffer Photons { uvec4 photons[]; };
layout(set = 1, binding = 2, scalar) readonly buffer Counters { uint counters[]; };

layout(constant_id = 5) const bool HAS_SLOTS = false;

void gather()
{
    uint index = push.first_point + gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (index >= push.end_point) {
        return;
    }
    Site site = site_of(points[index]);
    uint list_length = HAS_SLOTS ? push.photon_capacity : min(counters[0], push.photon_capacity);
    uint begin = (push.first_slice + gl_WorkGroupID.y) * GATHER_SLICE;
    uint end = min(begin + GATHER_SLICE, list_length);

    Gathered gathered = nothing_gathered();
    for (uint i = begin; i < end; i++) {
        uvec4 photon = photons[i];
        if (within_radius(site, photon)) {
            gather_photon(gathered, photon);
        }
    }
    add_gathered(index, gathered);
}
