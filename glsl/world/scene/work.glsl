// How the camera paths of a round are divided into dispatches and invocations.

// A sample of a pixel, or of a receiver.
struct Sample {
    // Among all of all pixels.
    uint place;
    uint pixel;
    // Among those of the pixel, and how many these are.
    uint number;
    uint count;
};

// How rounds divide their work.
struct WorkDivision {
    // Paths from the eye through a pixel in a round, a power of two. Each looks caustics up, and what it sees in mirrors or
    // glass; of a surface that is seen straight, the first one looks up the global map and gathers for all.
    uint samples;
    // Rays towards lights from a visible point, each to a light of its own choice, where any are cast.
    uint shadow_rays;
    // Rounds of a block, a power of two: samples of a place are even over all of them together, and no block knows of another.
    uint rounds_per_block;
    // Samples that some pixels have beyond `samples`, all together.
    uint extra_samples;
};
