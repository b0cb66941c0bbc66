// The stored photons as the index reads them: a list, or the naive builder's slots. Some of either may be empty.

layout(set = 1, binding = 0, scalar) readonly buffer Photons { uvec4 photons[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Counters { uint counters[]; };

layout(constant_id = 5) const bool HAS_SLOTS = false;

uint photon_list_length(uint photon_capacity)
{
    return HAS_SLOTS ? photon_capacity : min(counters[0], photon_capacity);
}
