// What the persistent builder needs of the paper's box.

#include "world/room/photon_push.glsl"

layout(push_constant, scalar) uniform Push { TracePersistentPush push; };

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
#include "world/room/disc.glsl"
#include "world/room/step.glsl"
#include "world/room/emit.glsl"

uint photon_capacity()
{
    return push.photon_capacity;
}

uint tally_row(uint bounce)
{
    return bounce;
}

// Photons of the dispatch, and the bounces that one of them takes in it.
uint photon_count()
{
    return push.range.count;
}

uint first_bounce()
{
    return 0;
}

uint end_of_bounces()
{
    return push.bounces;
}

PhotonState take_photon(uint index)
{
    return leave_light(index, push.range);
}

// What becomes of a path that is alive after its last bounce here. The ledger knows its fate.
void leave_path(PhotonState path, uint bounce)
{
}
