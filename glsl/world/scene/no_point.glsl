// A visible point that nothing arrives at.
VisiblePoint no_point()
{
    return VisiblePoint(vec3(0.0), 0, vec3(0.0), 0, 0, 0.0, SURFACE_RECEIVER, 0);
}
