// Push constants of the kernels that emit and trace photons in the paper's box.

#include "rng/random_key.glsl"

struct EmitPush {
    RandomKey key;
    PhotonRange range;
    uint path_offset;
    uint path_capacity;
};

struct TracePush {
    RandomKey key;
    uint bounce;
    uint bounces;
    uint path_capacity;
    uint photon_capacity;
    vec3 eye;
};

struct TracePersistentPush {
    RandomKey key;
    PhotonRange range;
    // Invocations that take photons: each every so many.
    uint stride;
    uint bounces;
    uint photon_capacity;
    vec3 eye;
};
