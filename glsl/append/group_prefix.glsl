// How many invocations of a work group want something, and how many of them stand before this one.

struct GroupPrefix {
    uint before;
    uint total;
};

shared uint subgroup_counts[MAX_SUBGROUPS];

// Called by every invocation, in uniform control flow.
GroupPrefix prefix_in_group(bool wanted)
{
    uvec4 votes = subgroupBallot(wanted);
    barrier(); // what an earlier call left has been read
    if (subgroupElect()) {
        subgroup_counts[gl_SubgroupID] = subgroupBallotBitCount(votes);
    }
    barrier();
    GroupPrefix prefix = GroupPrefix(subgroupBallotExclusiveBitCount(votes), 0);
    for (uint s = 0; s < gl_NumSubgroups; s++) {
        prefix.before += s < gl_SubgroupID ? subgroup_counts[s] : 0;
        prefix.total += subgroup_counts[s];
    }
    return prefix;
}
