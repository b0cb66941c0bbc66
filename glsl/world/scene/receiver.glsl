// A point and its normals, of which irradiance is asked.
struct Receiver {
    vec3 position;
    vec3 normal;
    vec3 shading_normal;
};
