// The photon ledger: the fate of every path that entered a bounce, counted in the work group first,
// so that a work group costs four atomics at most whatever the builder.
// The including kernel declares the buffer `tallies`.

shared uint group_tally[4];

// Called by the invocations of a subgroup together: of how many of their paths each is true.
uvec4 fates(bool stored, bool absorbed, bool escaped, bool dropped)
{
    return uvec4(subgroupBallotBitCount(subgroupBallot(stored)), subgroupBallotBitCount(subgroupBallot(absorbed)),
                 subgroupBallotBitCount(subgroupBallot(escaped)), subgroupBallotBitCount(subgroupBallot(dropped)));
}

// Called once by every invocation, in uniform control flow, with the counts of its subgroup.
void tally(uint bounce, uvec4 counts)
{
    if (gl_LocalInvocationIndex < 4) {
        group_tally[gl_LocalInvocationIndex] = 0;
    }
    barrier();
    if (subgroupElect()) {
        for (uint fate = 0; fate < 4; fate++) {
            if (counts[fate] != 0) {
                atomicAdd(group_tally[fate], counts[fate]);
            }
        }
    }
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        uint copy = tally_copy(bounce);
        if (group_tally[0] != 0) atomicAdd(tallies[copy].stored, group_tally[0]);
        if (group_tally[1] != 0) atomicAdd(tallies[copy].absorbed, group_tally[1]);
        if (group_tally[2] != 0) atomicAdd(tallies[copy].escaped, group_tally[2]);
        if (group_tally[3] != 0) atomicAdd(tallies[copy].dropped, group_tally[3]);
    }
}
