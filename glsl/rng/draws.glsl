// Whose random numbers are drawn: seed, round, and a `DOMAIN_...`.
struct Draws {
    uvec2 seed;
    uint round;
    uint domain;
};
