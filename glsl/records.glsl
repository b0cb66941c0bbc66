// Records that Rust and GLSL share, in `scalar` layout. Twin of src/records.rs, which explains the
// fields; tests/layout.rs compares the two field by field. Every kernel includes it first.
#extension GL_EXT_scalar_block_layout : require

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

struct PhotonRange {
    uint light;
    uint first_photon;
    uint count;
    uint first_sample;
    uvec2 jump_multiplier;
    uvec2 jump_increment;
};

struct EmitPush {
    RandomKey key;
    PhotonRange range;
    uint path_offset;
    uint path_capacity;
};

struct TracePush {
    RandomKey key;
    uint bounce;
    uint bounces;
    uint path_capacity;
    uint photon_capacity;
    vec3 eye;
};

struct FillGapsPush {
    uint bounce;
    uint bounces;
    uint path_capacity;
    uint photon_capacity;
};

struct EndBouncePush {
    uint bounce;
    uint photon_capacity;
    uint items_per_group;
    uint max_groups;
};

struct TracePersistentPush {
    RandomKey key;
    PhotonRange range;
    uint stride;
    uint bounces;
    uint photon_capacity;
    vec3 eye;
};

struct DispatchSizePush {
    uint counter;
    uint capacity;
    uint items_per_group;
    uint max_groups;
};

struct ClearancePush {
    uint point_count;
};

struct CrowdSizePush {
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

struct TreePush {
    uint photon_capacity;
    uint axis;
    uint digit;
    uint height;
};

struct NearestPush {
    uint first_point;
    uint end_point;
    uint nearest;
    uint is_first;
    float radius_squared;
    uint film_shift;
};

struct Search {
    uint next_leaf;
    uint found;
    float limit;
};

struct BvhNode {
    vec3 origin;
    uint spacing;
    uint first_child;
    uint first_triangle;
    uvec2 meta;
    uvec2 min_x;
    uvec2 max_x;
    uvec2 min_y;
    uvec2 max_y;
    uvec2 min_z;
    uvec2 max_z;
};

struct Triangle {
    vec3 a;
    vec3 b;
    vec3 c;
    uint material;
    uint plane;
};

struct TriangleNormals {
    uint a;
    uint b;
    uint c;
};

struct TriangleUvs {
    vec2 base_a;
    vec2 base_b;
    vec2 base_c;
    vec2 emission_a;
    vec2 emission_b;
    vec2 emission_c;
};

struct SurfaceMaterial {
    vec3 base_colour;
    uint surface;
    vec3 emission;
    float parameter;
    uint base_texture;
    uint emission_texture;
    uint two_sided;
};

struct TextureInfo {
    uint width;
    uint height;
    uint first_texel;
    uint wrap;
};

struct Emitter {
    uint kind;
    uint triangle;
    float cumulative;
    float probability;
    vec3 flux;
    vec3 strength;
    vec3 position;
    vec3 direction;
    float size;
    float outer_versine;
};

struct CausticTarget {
    vec3 centre;
    float radius;
};

struct CameraPath {
    vec3 position;
    uint place;
    vec3 direction;
    uint state;
    vec3 weight;
};

struct VisiblePoint {
    vec3 position;
    uint plane;
    vec3 weight;
    uint shading_normal;
    uint wo;
    float exponent;
    uint surface;
    uint arrivals;
};

struct Receiver {
    vec3 position;
    vec3 normal;
    vec3 shading_normal;
};

struct Draws {
    uvec2 seed;
    uint round;
    uint domain;
};

struct PhotonEmission {
    uint first_photon;
    uint photon_count;
    uint emitter_count;
    float scene_radius;
    uint target_count;
    float flux_gain;
};

struct PhotonStore {
    uint photon_capacity;
    uint stored;
    uint caustic_only;
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
    uint list;
    uint is_last;
    uint counts_left;
    uint path_capacity;
};

struct SceneTracePersistentPush {
    Draws draws;
    PhotonEmission emission;
    PhotonStore map;
    uint bounces;
    uint first_bounce;
    uint flights;
    uint stride;
};

struct GoOnPush {
    Draws draws;
    uint path_count;
    uint pixel_count;
    uint emitter_count;
    float film_scale;
    float film_limit;
    uint rounding;
};

struct ViewPush {
    Draws draws;
    uint rounding;
    uint width;
    uint height;
    uint first_pixel;
    uint end_pixel;
    vec3 eye;
    vec3 forward;
    vec3 right;
    vec3 up;
    uint emitter_count;
    float film_scale;
    float film_limit;
};

struct ReceivePush {
    Draws draws;
    uint rounding;
    uint first_point;
    uint end_point;
    uint point_count;
    uint emitter_count;
    float film_scale;
    float film_limit;
    float radius;
};

struct CellPush {
    vec3 origin;
    float cells_per_unit;
    uint bucket_mask;
    uint photon_capacity;
};

struct SceneGatherPush {
    uint first_point;
    uint end_point;
    uint point_count;
    uint pixel_count;
    uint arrival;
    uint round;
    uint rounding;
    uint width;
    uint height;
    uint first_slice;
    uint lanes;
    float radius;
    CellPush cells;
};

struct FluxToRadiancePush {
    uint first_point;
    uint end_point;
    uint point_count;
    uint pixel_count;
    uint width;
    uint height;
    uint arrivals;
    uint round;
    uint rounding;
    float film_scale;
    float film_limit;
    float global_radius;
    float caustic_radius;
    float global_flux;
    float caustic_flux;
};

struct ResolvePush {
    uint first_pixel;
    uint end_pixel;
    uint pixel_count;
    uint points_per_pixel;
};

struct EndRoundPush {
    uint sum_count;
};

struct CheckPush {
    uint iteration_count;
    uint addend_low;
    uint addend_high;
    uint add_count;
    uint photon_count;
    uint stride;
};

struct MathResults {
    float converted;
    float sum_of_product;
    float quotient;
    float root;
    float inverse_root;
    float exp2;
    float log2;
    float angle;
    float asinh;
};

struct SamplingCase {
    uvec2 words;
    vec3 normal;
    float exponent;
    vec3 a;
    vec3 b;
    vec3 c;
};

struct Samples {
    vec3 cosine_hemisphere;
    vec3 uniform_hemisphere;
    vec3 sphere;
    vec3 lobe;
    vec3 disc;
    vec2 triangle;
    vec2 filter_offset;
    vec3 in_triangle;
    float solid_angle;
    vec3 tangent;
    vec3 bitangent;
    vec3 unpacked_normal;
    vec3 unpacked_direction;
};

struct PackingCase {
    vec3 position;
    uint wall;
    vec3 direction;
    uint photon;
    uvec2 stream;
    float flux;
    float weight;
    vec3 colour;
    uint normal_code;
    Room room;
};

struct UnpackedRoom {
    vec3 place;
    uint wall;
    float flux;
    float weight;
    vec3 position;
    uint path_wall;
    vec3 direction;
    uint photon;
    uvec2 stream;
    float path_flux;
};

struct UnpackedScene {
    vec3 position;
    uint plane;
    vec3 flux;
    uint wi;
    uint normal_code;
    vec3 normal;
    uint direction_code;
    vec3 low;
    vec3 high;
    uint meta;
    uint child_nodes;
};

struct MeasurePush {
    uint item_count;
    uint step_count;
    uint mask;
};
