// Places from one counter of several, so that no single one has to serve all work groups of a device: they take the
// counters round-robin, and each counter's places in blocks as long as a work group. The last blocks of some counters then have
// gaps, which kernels/fill_gaps.comp marks as empty. Kernels that include this have work groups of the same length, and
// lists_end(), the number of counters before these.

layout(constant_id = 42) const uint COUNTERS = 1;

// Behind the lengths of the photon map and of each bounce's paths, and far enough from each other not to be served together.
uint striped_counter(uint turn)
{
    return lists_end() + turn * COUNTER_STRIDE;
}

uint striped_place(uint turn, uint taken)
{
    uint block = gl_WorkGroupSize.x;
    return (taken / block * COUNTERS + turn) * block + taken % block;
}
