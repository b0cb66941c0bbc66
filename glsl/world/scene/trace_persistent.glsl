// What the persistent builder needs of a scene of triangles. Photons come from their lights, or from the list of those that an
// earlier dispatch left under way. Those that are still under way after push.flights bounces go to the next list; after
// push.bounces bounces in all they are cut off.

#include "world/scene/photon_push.glsl"

layout(push_constant, scalar) uniform Push { SceneTracePersistentPush push; };

#include "world/scene/rays.glsl"
#include "world/scene/areas.glsl"
#include "world/scene/lights.glsl"
#include "world/scene/photon_state.glsl"
#include "world/scene/aim.glsl"
#include "material/bsdf.glsl"
#include "ledger/totals.glsl"
#include "world/scene/photon.glsl"
#include "world/scene/map.glsl"
#include "world/scene/lists.glsl"
#include "world/scene/step.glsl"
#include "world/scene/emit.glsl"

uint photon_capacity()
{
    return push.map.photon_capacity;
}

uint tally_row(uint bounce)
{
    return min(bounce, TALLY_ROWS - 1);
}

// Photons of the dispatch, and the bounces that one of them takes in it.
uint photon_count()
{
    return push.emission.photon_count;
}

uint first_bounce()
{
    return push.first_bounce;
}

uint end_of_bounces()
{
    return push.first_bounce + push.flights;
}

PhotonState take_photon(uint index)
{
    uint photon = push.emission.first_photon + index;
    if (push.first_bounce == 0) {
        return leave_light(photon, push.draws, push.emission);
    }
    return incoming_path(photon);
}

// What becomes of a path that is alive after its last bounce here.
void leave_path(PhotonState path, uint bounce)
{
    if (bounce < push.bounces) {
        store_path(atomicAdd(counters[1], 1), path);
    } else {
        count_loss(TOTAL_CUT_OFF, path.flux);
    }
}
