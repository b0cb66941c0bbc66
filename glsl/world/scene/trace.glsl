// What a builder that goes bounce by bounce needs of a scene of triangles: the push constants, the lists of paths, the photon map,
// and step_path(), which takes a path to the next surface.

#include "world/scene/photon_push.glsl"

layout(push_constant, scalar) uniform Push { FlightPush push; };

#include "world/scene/rays.glsl"
#include "material/bsdf.glsl"
#include "ledger/totals.glsl"
#include "world/scene/photon.glsl"
#include "world/scene/photon_state.glsl"
#include "world/scene/map.glsl"
#include "world/scene/lists.glsl"
#include "world/scene/bounce.glsl"
#include "world/scene/step.glsl"
