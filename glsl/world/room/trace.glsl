// What a builder that goes bounce by bounce needs of the paper's box: the push constants, the lists of paths, the photon map, and
// step_path(), which takes a path to the next wall.

#include "world/room/photon_push.glsl"

layout(push_constant, scalar) uniform Push { TracePush push; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/rng.glsl"
#include "rng/sampling.glsl"
#include "world/room/geometry.glsl"
#include "world/room/photon.glsl"
#include "world/room/photon_state.glsl"
#include "world/room/map.glsl"
#include "material/phong_weight.glsl"
#include "world/room/lists.glsl"
#include "world/room/bounce.glsl"
#include "world/room/step.glsl"
