// A photon in flight through a scene of triangles.
struct PhotonState {
    vec3 position;
    // Number within its round.
    uint photon;
    vec3 direction;
    // `ARRIVED_...`, were it stored at its next hit.
    uint arrival;
    vec3 flux;
    // What it runs through (glsl/material/media.glsl).
    uint media;
};
