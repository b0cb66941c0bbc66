// Records that Rust and GLSL share, in `scalar` layout. Twin of src/records.rs, which explains the
// fields; tests/layout.rs compares the two field by field.

struct Room {
    vec3 min_corner;
    vec3 max_corner;
};

struct Wall {
    vec3 normal;
    float albedo;
    vec3 tangent;
    float shininess;
    vec3 bitangent;
    uint is_open;
};

struct DiscLight {
    vec3 centre;
    float radius;
    uint wall;
    float flux;
};

struct Path {
    vec3 position;
    uint wall;
    vec3 direction;
    uint photon;
    uvec2 stream;
    float flux;
};

struct Photon {
    vec3 position;
    uint wall;
    float flux;
    float weight;
    uint photon;
    uint bounce;
};

struct SortedPhoton {
    vec3 position;
    uint wall;
    float flux;
    float weight;
};

struct Point {
    vec3 position;
    uint wall;
};

struct Tally {
    uint stored;
    uint absorbed;
    uint escaped;
    uint dropped;
};

struct DispatchArgs {
    uint x;
    uint y;
    uint z;
};

struct RandomKey {
    uvec2 seed;
    uint round;
    uint photons_before;
    uvec2 leap_multiplier;
    uvec2 leap_increment;
};

struct EmitPush {
    RandomKey key;
    uint light;
    uint first_photon;
    uint photon_count;
    uint path_offset;
    uvec2 jump_multiplier;
    uvec2 jump_increment;
};

struct TracePush {
    RandomKey key;
    uint bounce;
    uint path_capacity;
    uint photon_capacity;
    vec3 eye;
};

struct DispatchSizePush {
    uint counter;
    uint capacity;
    uint items_per_group;
    uint max_groups;
};

struct IndexPush {
    vec3 origin;
    float cells_per_metre;
    uvec3 cell_count;
    uint photon_capacity;
};

struct ScanPush {
    uint item_count;
};

struct GatherPush {
    uint first_point;
    uint end_point;
    uint first_slice;
    uint photon_capacity;
    float radius_squared;
    float reach;
    float film_scale;
    vec3 origin;
    float cells_per_metre;
    uvec3 cell_count;
};

struct CheckPush {
    uint iteration_count;
    uint addend_low;
    uint addend_high;
    uint add_count;
};
