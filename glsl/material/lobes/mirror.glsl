// A perfect mirror.

#include "material/layers.glsl"
#include "material/scatter.glsl"

Scatter sample_mirror(Surface surface, vec3 wo)
{
    vec3 wi = on_side(mirrored(wo, surface.ns), surface.ng);
    return Scatter(wi, surface.base_colour, dot(wi, surface.ng) > 0.0, true, false, 0.0);
}
