// Push constants of the kernels that emit and trace photons in a scene of triangles.

#include "rng/draws.glsl"

// Photons that leave the lights of a scene.
struct PhotonEmission {
    uint first_photon;
    uint photon_count;
    uint emitter_count;
    // Of a sphere around the scene.
    float scene_radius;
    // Spheres that they are aimed at; 0: at none.
    uint target_count;
    // 1: those from beyond the scene are aimed at its openings.
    uint through_openings;
    // What aimed photons' flux is multiplied by; see [`crate::plan::scene::MapPlan::flux_gain`].
    float flux_gain;
};

// Which photons a map holds.
struct PhotonStore {
    uint photon_capacity;
    // Mask of the arrivals that are stored.
    uint stored;
    // 1: photons end where they scatter, as those of a caustic map do.
    uint caustic_only;
    // 1: and so each lands once at most, as no surface that keeps photons lets light pass.
    uint lands_once;
    // Mask of the surfaces (1 << `SURFACE_...`) whose caustics are wanted.
    uint caustic_surfaces;
};

struct EmissionPush {
    Draws draws;
    PhotonEmission emission;
};

struct FlightPush {
    Draws draws;
    PhotonStore map;
    uint bounce;
    // Number of the list that its paths come from: [`crate::engine::scene::trace`] counts them from 0 in each segment.
    uint list;
    // 1: no path goes on after it.
    uint is_last;
    // 1: the naive builder says how many paths are left.
    uint counts_left;
    uint path_capacity;
};

struct SceneTracePersistentPush {
    Draws draws;
    PhotonEmission emission;
    PhotonStore map;
    // Bounces after which photons are cut off.
    uint bounces;
    // Bounces that its photons have behind them; 0: they come from their lights.
    uint first_bounce;
    // Most flights of a photon in this dispatch.
    uint flights;
    // Invocations that take photons: each every so many.
    uint stride;
};
