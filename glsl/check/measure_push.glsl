// A measurement of a device's limits; see `glsl/kernels/measure_...`.
struct MeasurePush {
    uint item_count;
    // What one invocation does, times over.
    uint step_count;
    // Of random places, which are below a power of two.
    uint mask;
};
