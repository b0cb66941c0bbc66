// How many things the invocations of a work group want, and how many of them come before each.

struct GroupPrefix {
    uint before[PLACES];
    uint total;
};

shared uint subgroup_counts[MAX_SUBGROUPS];

// Called by every invocation, in uniform control flow.
GroupPrefix prefix_in_group(bool[PLACES] wanted)
{
    GroupPrefix prefix;
    uint count = 0;
    for (uint k = 0; k < PLACES; k++) {
        uvec4 votes = subgroupBallot(wanted[k]);
        prefix.before[k] = count + subgroupBallotExclusiveBitCount(votes);
        count += subgroupBallotBitCount(votes);
    }
    barrier(); // what an earlier call left has been read
    if (subgroupElect()) {
        subgroup_counts[gl_SubgroupID] = count;
    }
    barrier();
    prefix.total = 0;
    uint before = 0;
    for (uint s = 0; s < gl_NumSubgroups; s++) {
        before += s < gl_SubgroupID ? subgroup_counts[s] : 0;
        prefix.total += subgroup_counts[s];
    }
    for (uint k = 0; k < PLACES; k++) {
        prefix.before[k] += before;
    }
    return prefix;
}

// Work groups of as many paths as there may be.
uint group_count()
{
    return (push.path_capacity + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x;
}
