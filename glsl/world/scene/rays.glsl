// What every kernel that follows rays through the scene is made of: numbers, random numbers, triangles and their surfaces.

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"
#include "rng/sampling.glsl"
#include "world/scene/effects.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "material/surface.glsl"
