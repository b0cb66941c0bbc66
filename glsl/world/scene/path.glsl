// A photon in flight through a scene of triangles, and its path between bounces.

struct LightPath {
    vec3 position;
    uint photon;
    vec3 direction;
    uint arrival;
    vec3 flux;
};
