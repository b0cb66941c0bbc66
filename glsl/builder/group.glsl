// One atomic a work group: a prefix sum over the group finds each survivor's place in the
// group's block.

const uint PLACES = PATHS_EACH;

#include "builder/group_prefix.glsl"

shared uint group_base;

uint[PLACES] take_places(uint counter, bool[PLACES] wanted)
{
    GroupPrefix prefix = prefix_in_group(wanted);
    if (gl_LocalInvocationIndex == 0) {
        group_base = prefix.total == 0 ? 0 : atomicAdd(counters[counter], prefix.total);
    }
    barrier();
    for (uint k = 0; k < PLACES; k++) {
        prefix.before[k] += group_base;
    }
    return prefix.before;
}

#include "builder/compact.glsl"
