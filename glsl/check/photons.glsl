// A world for the start-up check of builder/persistent.glsl: each photon takes a number of bounces that follows from its own number,
// leaves one entry of the map at every second, and is longer on its way than its neighbours. Twin of src/gpu/check.rs.

const bool STORED_IS_ALIVE = false;

layout(set = 1, binding = 2, scalar) writeonly buffer Entries { uint entries[]; };

struct PhotonState {
    uint photon;
};

struct Photon {
    uint entry;
};

#include "world/step.glsl"

uint hash_of(uint number)
{
    return (number * 747796405u + 2891336453u) >> 16;
}

Step no_step()
{
    return Step(false, false, false, false, Photon(0));
}

Step step_path(inout PhotonState path, uint bounce)
{
    uint hash = path.photon;
    // Neighbours are apart when they come to the next vote.
    for (uint k = 0; k < hash_of(path.photon + bounce) % 7u; k++) {
        hash = hash_of(hash);
    }
    bool alive = bounce < hash_of(path.photon) % 11u;
    return Step(!alive && hash == 0xffffffffu, !alive && hash != 0xffffffffu, bounce % 2u == 0, alive, Photon(16u * path.photon + bounce));
}

void store_photon(uint place, Photon photon)
{
    entries[place] = photon.entry;
}

uint photon_capacity()
{
    return 16u * push.photon_count;
}

uint tally_row(uint bounce)
{
    return 0;
}

uint photon_count()
{
    return push.photon_count;
}

uint first_bounce()
{
    return 0;
}

uint end_of_bounces()
{
    return 16;
}

PhotonState take_photon(uint index)
{
    return PhotonState(index);
}

void leave_path(PhotonState path, uint bounce)
{
}
