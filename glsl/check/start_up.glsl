// What every run relies on: loops that count right, a ballot that orders the lanes, and film sums that
// carry. The including kernel chose how the film adds.

layout(set = 1, binding = 1, scalar) buffer Answers { uint answers[]; };

void check_device()
{
    // answers[0]: iterations done, of push.iteration_count; answers[1]: what they computed, which
    // the host computes too.
    uint chain = 1;
    uint iteration = 0;
    for (; iteration < push.iteration_count; iteration++) {
        chain = chain * 1664525u + 1013904223u;
    }
    if (gl_LocalInvocationIndex == 0) {
        answers[0] = iteration;
        answers[1] = chain;
    }

    // answers[2]: survivors among the odd lanes; answers[3]: sum of their exclusive counts;
    // answers[4]: subgroups.
    bool survives = (gl_SubgroupInvocationID & 1) == 1;
    uvec4 ballot = subgroupBallot(survives);
    if (survives) {
        atomicAdd(answers[2], 1);
        atomicAdd(answers[3], subgroupBallotExclusiveBitCount(ballot));
    }
    if (subgroupElect()) {
        atomicAdd(answers[4], 1);
    }

    for (uint i = 0; i < push.add_count; i++) {
        add_to_film(0, uvec2(push.addend_low, push.addend_high));
    }
}
