// The modified store with one atomic a work group: a prefix sum over the group finds each survivor's place in the
// group's block.

shared uint group_base;

uint take_place(uint counter, bool wanted)
{
    GroupPrefix prefix = prefix_in_group(wanted);
    if (gl_LocalInvocationIndex == 0) {
        group_base = prefix.total == 0 ? 0 : atomicAdd(counters[counter], prefix.total);
    }
    barrier();
    return group_base + prefix.before;
}
