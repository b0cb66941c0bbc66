// What kernels/emit.comp needs of a scene of triangles.

#include "world/scene/photon_push.glsl"

layout(push_constant, scalar) uniform Push { EmissionPush push; };

#include "world/scene/rays.glsl"
#include "world/scene/areas.glsl"
#include "world/scene/lights.glsl"
#include "world/scene/photon_state.glsl"
#include "world/scene/aim.glsl"
#include "world/scene/emit.glsl"

layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { PhotonState next_paths[]; };

uint photon_count()
{
    return push.emission.photon_count;
}

void write_photon(uint index)
{
    next_paths[index] = leave_light(push.emission.first_photon + index, push.draws, push.emission);
}
