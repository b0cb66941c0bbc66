// --paranoid: positions, directions, flux and radiance that are infinite or no number are counted where they arise,
// and the first of them written down with whose they are.

layout(constant_id = 31) const bool PARANOID = false;

// For each kind ODD_...: how many there are, then three words each of the first: the photons' domain, round, item.
// Kinds have room of their own, so that many pixels do not keep a photon's name out.
layout(set = 1, binding = 15, scalar) buffer NonfiniteValues { uint nonfinite_values[]; };

const uint NONFINITE_WORDS = 1 + 3 * MAX_NONFINITE_VALUES;

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
        // As many as count; more would wrap.
        uint kind = what * NONFINITE_WORDS;
        if (!fine && nonfinite_values[kind] < 0x40000000u) {
            uint place = atomicAdd(nonfinite_values[kind], 1);
            if (place < MAX_NONFINITE_VALUES) {
                nonfinite_values[kind + 3 * place + 1] = domain;
                nonfinite_values[kind + 3 * place + 2] = round;
                nonfinite_values[kind + 3 * place + 3] = item;
            }
        }
    }
}
