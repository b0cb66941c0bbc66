// What a layered material is at a point: factors times textures. The guide's page on materials has the symbols.

// Lobes of GGX sharper than that are deltas; those that are broader than the other belong to photon maps.
const float DELTA_ALPHA = 1.0 / float(DELTA_ALPHA_INVERSE);
const float MAP_ALPHA = float(MAP_ALPHA_PER_MILLE) / 1000.0;
const float LEAST_SHEEN_ALPHA = 0.01;
// No mapped normal looks further away from the eye.
const float LEAST_MAPPED_COSINE = 0.01;

struct Layers {
    float metallic;
    float alpha; // of a stretched base, across its tangent
    bool is_stretched;
    float alpha_along;
    vec3 tangent;
    float ior;
    float ior_spread;
    float specular;
    vec3 specular_colour;
    float transmission;
    bool is_solid;
    uint medium; // its number; 0: none
    float diffuse_transmission;
    vec3 diffuse_transmission_colour;
    float iridescence;
    float film_ior;
    float film_thickness;
    float film_bound;
    float coat;
    float coat_alpha;
    vec3 coat_normal;
    vec3 sheen;
    float sheen_alpha;
    float coverage;
    bool is_unlit;
};

// What a ray met.
struct Surface {
    vec3 position;
    float error; // bound of each coordinate's
    uint plane; // twice its number, plus 1 on the back
    vec3 ng; // geometric normal on the side of wo
    vec3 ns; // shading normal on the same side
    bool front;
    bool scatters;
    uint kind;
    float parameter;
    vec3 base_colour;
    vec3 emission; // radiance towards wo
    Layers layers; // of SURFACE_LAYERED
};
