// What builder/scan_move.glsl needs of a scene of triangles.

#include "world/scene/photon_push.glsl"

layout(push_constant, scalar) uniform Push { FlightPush push; };

#include "ledger/totals.glsl"
#include "world/scene/photon.glsl"
#include "world/scene/photon_state.glsl"
#include "world/scene/map.glsl"
#include "world/scene/lists.glsl"
#include "world/scene/bounce.glsl"
