// The ledger of invocations that are not at the same bounce: fates are counted in the work group's memory and added
// to the device's once. The including kernel declares the buffer `tallies`, one of push.bounces.

const uint FATE_STORED = 0;
const uint FATE_ABSORBED = 1;
const uint FATE_ESCAPED = 2;
const uint FATE_DROPPED = 3;

shared uint group_tallies[4 * GROUP_TALLIES];

// Called once by every invocation, in uniform control flow.
void open_tallies()
{
    for (uint k = gl_LocalInvocationIndex; k < 4 * GROUP_TALLIES; k += gl_WorkGroupSize.x) {
        group_tallies[k] = 0;
    }
    barrier();
}

void count_on_device(uint bounce, uint fate, uint count)
{
    switch (fate) {
        case FATE_STORED: atomicAdd(tallies[tally_copy(bounce)].stored, count); break;
        case FATE_ABSORBED: atomicAdd(tallies[tally_copy(bounce)].absorbed, count); break;
        case FATE_ESCAPED: atomicAdd(tallies[tally_copy(bounce)].escaped, count); break;
        default: atomicAdd(tallies[tally_copy(bounce)].dropped, count);
    }
}

// The fate of one path that entered a bounce: dropped if none is named.
void count_fate(uint bounce, bool stored, bool absorbed, bool escaped)
{
    uint fate = stored ? FATE_STORED : (absorbed ? FATE_ABSORBED : (escaped ? FATE_ESCAPED : FATE_DROPPED));
    if (bounce < GROUP_TALLIES) {
        atomicAdd(group_tallies[4 * bounce + fate], 1);
    } else {
        // Few photons live that long, unless the walls are white.
        count_on_device(bounce, fate, 1);
    }
}

// Called once by every invocation, in uniform control flow.
void close_tallies()
{
    barrier();
    for (uint k = gl_LocalInvocationIndex; k < 4 * GROUP_TALLIES; k += gl_WorkGroupSize.x) {
        if (group_tallies[k] != 0) {
            count_on_device(k / 4, k % 4, group_tallies[k]);
        }
    }
}
