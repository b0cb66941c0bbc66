// What builder/scan_move.glsl needs of the paper's box.

#include "world/room/photon_push.glsl"

layout(push_constant, scalar) uniform Push { TracePush push; };

#include "world/room/photon.glsl"
#include "world/room/photon_state.glsl"
#include "world/room/map.glsl"
#include "world/room/lists.glsl"
#include "world/room/bounce.glsl"
