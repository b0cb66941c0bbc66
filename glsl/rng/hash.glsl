// Bijective 32-bit finaliser (Wellons, "prospecting for hash functions", lowbias32): distinct numbers get distinct ones
// that look random.
uint mix32(uint x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}
