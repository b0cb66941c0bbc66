// Equal radiance in all directions. The paper's Phong scatters so, too.

#include "rng/sampling.glsl"
#include "math/directions.glsl"
#include "material/layers.glsl"
#include "material/scatter.glsl"

Scatter sample_lambert(Surface surface, vec2 u)
{
    vec3 wi = to_frame(sample_cosine_hemisphere(u.x, u.y), surface.ns);
    return Scatter(wi, surface.base_colour, dot(wi, surface.ng) > 0.0, false, false, 0.0);
}
