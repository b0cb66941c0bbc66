// The paper's modified store (section 3): every survivor takes the next place by an atomic of its own.

uint take_place(uint counter, bool wanted)
{
    return wanted ? atomicAdd(counters[counter], 1) : 0;
}
