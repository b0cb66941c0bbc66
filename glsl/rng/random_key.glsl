// What the random numbers of the paper's box depend on.

// What a photon's random numbers depend on beside its number.
struct RandomKey {
    uvec2 seed;
    uint round;
    // Photons of the rounds before this one, mod 2^32; mt seeds by the number in the run.
    uint photons_before;
    // rand48: multiplier and increment, 48 bits each, that lead from one draw of a photon to
    // its next.
    uvec2 leap_multiplier;
    uvec2 leap_increment;
};

// Photons of one light, in the order of their numbers.
struct PhotonRange {
    uint light;
    uint first_photon;
    uint count;
    // Number of `first_photon` among its light's photons of the run, mod 2^32.
    uint first_sample;
    // rand48: from the prepared state of photon i to the first state of photon
    // `first_photon` + i in this round.
    uvec2 jump_multiplier;
    uvec2 jump_increment;
};
