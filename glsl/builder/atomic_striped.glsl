// As builder/atomic.glsl, but from several counters, which work groups use round-robin where COUNTERS is above 1.

uint take_place(uint counter, bool wanted)
{
    if (COUNTERS == 1) {
        return wanted ? atomicAdd(counters[counter], 1) : 0;
    }
    uint turn = work_group_index() % COUNTERS;
    return wanted ? striped_place(turn, atomicAdd(counters[striped_counter(turn)], 1)) : 0;
}
