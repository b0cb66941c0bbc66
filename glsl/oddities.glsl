// --paranoid: positions, directions, flux and radiance that are infinite or no number are counted where they arise,
// and the first of them written down with whose they are.

layout(constant_id = 31) const bool PARANOID = false;

// [0]: how many there are; then four words each of the first: ODD_..., the photons' domain, round, item.
layout(set = 1, binding = 15, scalar) buffer Oddities { uint oddities[]; };

bool is_finite(float x)
{
    // By its bits, as a compiler may take it for granted that x is a number.
    return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u;
}

bool is_finite(vec3 v)
{
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// `item`: photon, pixel or receiver.
void note_unless(bool fine, uint what, uint domain, uint round, uint item)
{
    if (PARANOID) {
        if (!fine) {
            uint place = atomicAdd(oddities[0], 1);
            if (place < MAX_ODDITIES) {
                oddities[4 * place + 1] = what;
                oddities[4 * place + 2] = domain;
                oddities[4 * place + 3] = round;
                oddities[4 * place + 4] = item;
            }
        }
    }
}
