// A point whose light the photon maps are asked for.
struct VisiblePoint {
    vec3 position;
    // That it lies in: twice its number, plus 1 on its back.
    uint plane;
    // What a unit of flux density that arrives adds to the pixel, W/m2/sr per W/m2.
    vec3 weight;
    // Octahedral; `NONE`: the plane's.
    uint shading_normal;
    // Towards the eye, octahedral.
    uint wo;
    float exponent;
    uint surface;
    // Mask of the arrivals that count, and `SEEN...`; 0: no point.
    uint arrivals;
};

// A visible point that nothing arrives at.
VisiblePoint no_point()
{
    return VisiblePoint(vec3(0.0), 0, vec3(0.0), 0, 0, 0.0, SURFACE_RECEIVER, 0);
}
