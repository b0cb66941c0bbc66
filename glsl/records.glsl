// Records that Rust and GLSL share, in `scalar` layout; build.rs makes Rust's of them. Every kernel includes this file first.
#extension GL_EXT_scalar_block_layout : require

// The axis-aligned room that holds the walls.
struct Room {
    vec3 min_corner;
    vec3 max_corner;
};

// One face of the room: a diffuse wall, or an opening.
struct Wall {
    // Into the room.
    vec3 normal;
    // Share of arriving photons that is reflected.
    float albedo;
    vec3 tangent;
    // Exponent of the Phong lobe; below 0 the wall is Lambertian.
    float shininess;
    vec3 bitangent;
    // 1: photons leave the scene here.
    uint is_open;
};

// A disc of light flush with a wall.
struct DiscLight {
    vec3 centre;
    float radius;
    uint wall;
    // Relative flux of each of its photons, in (0, 1].
    float flux;
};

// A point at which light is estimated.
struct Point {
    vec3 position;
    uint wall;
};

// Fates of the paths that entered one bounce.
struct Tally {
    uint stored;
    uint absorbed;
    uint escaped;
    uint dropped;
};

// `VkDispatchIndirectCommand`.
struct DispatchArgs {
    uint x;
    uint y;
    uint z;
};

// What a photon's random numbers depend on beside its number.
struct RandomKey {
    uvec2 seed;
    uint round;
    // Photons of the rounds before this one, mod 2^32; mt seeds by the number in the run.
    uint photons_before;
    // rand48: multiplier and increment, 48 bits each, that lead from one draw of a photon to
    // its next.
    uvec2 leap_multiplier;
    uvec2 leap_increment;
};

// Photons of one light, in the order of their numbers.
struct PhotonRange {
    uint light;
    uint first_photon;
    uint count;
    // Number of `first_photon` among its light's photons of the run, mod 2^32.
    uint first_sample;
    // rand48: from the prepared state of photon i to the first state of photon
    // `first_photon` + i in this round.
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
    // Invocations that take photons: each every so many.
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
    uint first_point;
    uint end_point;
    // Which of the distances in 8 directions is taken, in ascending order from 0.
    uint rank;
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
    // Points `first_point` to `end_point` - 1 and slices from `first_slice` on: what one dispatch
    // covers.
    uint first_point;
    uint end_point;
    uint first_slice;
    uint photon_capacity;
    float radius_squared;
    // A little over the radius: how far from the point a cell may lie.
    float reach;
    // Fixed-point units in 1.
    float film_scale;
    vec3 origin;
    float cells_per_metre;
    uvec3 cell_count;
};

// A step of building the kd-tree.
struct TreePush {
    uint photon_capacity;
    // 0: along the first axis of each wall, 1: along the second.
    uint axis;
    // Digit of the radix sort, `TREE_DIGITS`: the wall.
    uint digit;
    // Of the nodes that are split: they hold `TREE_LEAF` << `height` photons.
    uint height;
};

struct NearestPush {
    // Points `first_point` to `end_point` - 1.
    uint first_point;
    uint end_point;
    // How many photons are wanted.
    uint nearest;
    // 1: the searches begin.
    uint is_first;
    // Of the full radius: how far the nearest photons are looked for.
    float radius_squared;
    // log2 of the film's units in 1.
    uint film_shift;
};

// A search for a point's nearest photons, between two dispatches.
struct Search {
    // Leaves before it are done; `NONE`: all are.
    uint next_leaf;
    // Photons found.
    uint found;
    // Squared distance beyond which no photon is wanted.
    float limit;
};

// Node of a compressed wide BVH (Ylitie, Karras and Laine 2017): eight children in boxes of 8-bit
// planes.
struct BvhNode {
    vec3 origin;
    // Exponents of the planes' spacing along x, y, z, and the mask of children that are nodes, a
    // byte each.
    uint spacing;
    uint first_child;
    uint first_triangle;
    // A byte a child: where it is, or how many triangles it holds.
    uvec2 meta;
    uvec2 min_x;
    uvec2 max_x;
    uvec2 min_y;
    uvec2 max_y;
    uvec2 min_z;
    uvec2 max_z;
};

// In the order of the BVH's leaves; its front is where it runs counter-clockwise.
struct Triangle {
    vec3 a;
    vec3 b;
    vec3 c;
    uint material;
    // Number of its front's plane; plus `HIDDEN` if others that lie in it hide a part: then it counts as no surface,
    // triangles of their own stand for what is visible of it, and rays meet it only between those.
    uint plane;
};

// Shading normals at a triangle's corners, octahedral; all `NONE` on a flat triangle.
struct TriangleNormals {
    uint a;
    uint b;
    uint c;
};

// Texture coordinates at a triangle's corners.
struct TriangleUvs {
    vec2 base_a;
    vec2 base_b;
    vec2 base_c;
    vec2 emission_a;
    vec2 emission_b;
    vec2 emission_c;
};

// Linear colours at a triangle's corners, which multiply the material's base colour, and alphas.
struct TriangleColours {
    vec3 a;
    vec3 b;
    vec3 c;
    vec3 alphas;
};

// What layered materials need at a triangle's corners: texture coordinates of the mesh's first and second set; tangents, octahedral, for
// normal map and anisotropy, and for the normal map of the coat. Bits 0 and 3 of `turned`: their bitangents are -(normal x tangent).
struct TriangleLayers {
    vec2 first_a;
    vec2 first_b;
    vec2 first_c;
    vec2 second_a;
    vec2 second_b;
    vec2 second_c;
    uint tangent_a;
    uint tangent_b;
    uint tangent_c;
    uint coat_tangent_a;
    uint coat_tangent_b;
    uint coat_tangent_c;
    uint turned;
};

// What a layered material adds to its `SurfaceMaterial`.
struct LayeredMaterial {
    float metallic;
    float roughness;
    float ior;
    float specular;
    vec3 specular_colour;
    float transmission;
    // It encloses a medium; else it is a thin wall.
    uint is_solid;
    // Number of its medium, from 1; 0: it is no solid, or media do not matter.
    uint medium;
    // Of the medium whose number is this record's place plus 1, for each unit of length.
    vec3 medium_absorption;
    float medium_ior;
    // Half of what lies between the indices for red and for blue, of its solid, and of that medium.
    float ior_spread;
    float medium_spread;
    // Of a thin film: how much of it is there, its index, its thickness, nanometres, from where a texture is 0 to where it is 1, and the
    // least F0 with which Schlick's formula is above all that it reflects.
    float iridescence;
    float film_ior;
    float film_least;
    float film_most;
    float film_bound;
    // Share of what enters it that is scattered evenly beyond, and its colour.
    float diffuse_transmission;
    vec3 diffuse_transmission_colour;
    // How much rougher the base is along a direction: 0 to 1, and cosine and sine of what turns the direction from the tangent.
    float anisotropy;
    vec2 anisotropy_turn;
    float coat;
    float coat_roughness;
    vec3 sheen_colour;
    float sheen_roughness;
    float normal_scale;
    float coat_normal_scale;
    // `COVERAGE_...`.
    uint coverage;
    float alpha;
    float cutoff;
    uint is_unlit;
    // Somewhere it has a lobe that photon maps know. Density estimates beside such a place count photons elsewhere, too.
    uint is_matt;
    // Its lookups, among the records of textures.
    uint first_lookup;
    uint end_lookup;
};

struct SurfaceMaterial {
    vec3 base_colour;
    // `SURFACE_...`.
    uint surface;
    // Radiance of the front, W/m2/sr.
    vec3 emission;
    // Exponent or index of refraction.
    float parameter;
    uint base_texture;
    uint emission_texture;
    uint two_sided;
};

// A texture; behind those of the scene, each that a layered material looks up, for which the rest counts.
struct TextureInfo {
    uint width;
    uint height;
    uint first_texel;
    // 0 repeat, 1 mirrored, 2 clamp: of u, and of v times 4; plus 16 where the nearest texel alone counts.
    uint wrap;
    // `TEXELS_...`.
    uint encoding;
    // `LAYER_...`: what it multiplies, or says.
    uint layer;
    uint uv_set;
    // It is looked up at (dot(row_u, uv), dot(row_v, uv)) + offset.
    vec2 row_u;
    vec2 row_v;
    vec2 offset;
};

// A light, or a triangle that shines. Lengths are those of the normalised scene.
struct Emitter {
    // `EMITTER_...`.
    uint kind;
    uint triangle;
    // Share of the emitters up to and with this one.
    float cumulative;
    float probability;
    // Relative flux of each of its photons.
    vec3 flux;
    // Radiance, radiant intensity or irradiance, as its kind has it; of a uniform disc the
    // intensity of a unit of area.
    vec3 strength;
    // Of a triangle the weights of its second and third corner where the piece that shines begins, and the piece's width over the
    // triangle's (`scene::geometry::lamp_pieces`).
    vec3 position;
    // Its axis or normal; a directional light's flight; towards the brightest part of a sky's picture.
    vec3 direction;
    // Radius of a disc; versine (1 - cosine) of a spot's inner cone, of which a narrow one keeps its digits.
    float size;
    // Versine of a spot's outer cone; of a sky, the share of light samples that its table chooses.
    float outer_versine;
    // Of a cone around the brightest part of a sky's picture.
    float sun_versine;
};

// A node of the tree of lights (`scene::light_tree`): those within a sphere.
struct LightNode {
    vec3 centre;
    float radius_squared;
    // Share of all lights' power.
    float power;
    // Of its children, which lie side by side, the first; of a leaf `LIGHT_LEAF` and its emitter.
    uint child;
};

// A node of the tree of regions, in each of which shadow rays choose lights alike (`plan::light_choice`).
struct LightRegion {
    // 0 to 2: a coordinate of the position, 3 to 5: of the normal; `NONE`: a leaf.
    uint axis;
    float split;
    // Of what lies below `split`, after which comes what lies above; of a leaf its number.
    uint next;
};

// A sphere around surfaces that make caustics, which photons are aimed at.
struct CausticTarget {
    vec3 centre;
    float radius;
};

// A ray of a trial, and the place that it meets with the normal of its side.
struct TrialRay {
    vec3 origin;
    vec3 direction;
    vec3 met;
    vec3 normal;
    // 1: it leaves the scene, and meets nothing.
    uint escapes;
};

struct TrialRaysPush {
    uvec2 seed;
    uint first_ray;
    uint end_ray;
    uint rays_of_point;
};

// A sample of a pixel, or of a receiver.
struct Sample {
    // Among all of all pixels.
    uint place;
    uint pixel;
    // Among those of the pixel, and how many these are.
    uint number;
    uint count;
};

// A path from the camera or a receiver, under way over mirrors and glass.
struct CameraPath {
    vec3 position;
    Sample own;
    vec3 direction;
    // Bits 0 to 3: it saw a specular surface, it gathers, it starts at no surface, emission counts at its next one; bits 4
    // and 5: visible points found; bit 6: it ends there; from bit 8 on: surfaces that it has met.
    uint state;
    vec3 weight;
    // Of its smooth ways, where the others were followed too (glsl/world/scene/other_ways.glsl).
    float chance;
    // What it runs through (glsl/material/media.glsl).
    uint media;
    // Of a direction that a sharp lobe gave it, 1/sr, and the point and the normal there; 0: none.
    float density;
    vec3 from;
    vec3 from_normal;
};

// A point whose light the photon maps are asked for.
struct VisiblePoint {
    vec3 position;
    // That it lies in: twice its number, plus 1 on its back.
    uint plane;
    // What a unit of flux density that arrives adds to the pixel, W/m2/sr per W/m2.
    vec3 weight;
    // Octahedral; `NONE`: the plane's.
    uint shading_normal;
    // Towards the eye, octahedral.
    uint wo;
    float exponent;
    uint surface;
    // Mask of the arrivals that count, and `SEEN...`; 0: no point.
    uint arrivals;
};

// How the matt lobes of a layered visible point weigh light (glsl/material/matt_lobes.glsl). Those that are none have weight 0.
struct MattLobes {
    // All of the diffuse lobe but the factors of where light comes from.
    vec3 diffuse;
    // What the dielectric reflects along its normal and at the horizon, in the largest channel.
    float e0;
    float e90;
    // Of the base's reflection.
    float alpha;
    vec3 f0;
    float f90;
};

// A thin film on the base: how much of it is there, and shares of dielectric and metal in what is reflected below it, with their F0.
struct MattFilm {
    float share;
    float ior;
    float thickness;
    float dielectric;
    vec3 f0;
    float metal;
    vec3 metal_f0;
    // What it reflects is no sharp lobe.
    uint is_matt;
};

// What lies over them.
struct MattCover {
    float coat;
    float coat_alpha;
    // It is no sharp lobe.
    uint has_coat_lobe;
    uint coat_normal;
    // What the coat reflects of all light towards the eye, and what white sheen would.
    float coat_albedo;
    float sheen_albedo;
    vec3 sheen;
    float sheen_alpha;
    // Under them; here for it to be stored (drivers allow few buffers).
    MattFilm film;
};

// A point and its normals, of which irradiance is asked.
struct Receiver {
    vec3 position;
    vec3 normal;
    vec3 shading_normal;
};

// Whose random numbers are drawn: seed, round, and a `DOMAIN_...`.
struct Draws {
    uvec2 seed;
    uint round;
    uint domain;
};

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

// What each cluster of lights adds at some points.
struct TryLightsPush {
    Draws draws;
    // Pairs of a point and a cluster, cluster by cluster of each point.
    uint first_pair;
    uint end_pair;
    uint cluster_count;
    // Shadow rays of each.
    uint ray_count;
};

// How rounds divide their work.
struct WorkDivision {
    // Paths from the eye through a pixel in a round, a power of two. Each looks caustics up, and what it sees in mirrors or
    // glass; of a surface that is seen straight, the first one looks up the global map and gathers for all.
    uint samples;
    // Rays towards lights from a visible point, each to a light of its own choice, where any are cast.
    uint shadow_rays;
    // Rounds of a block, a power of two: samples of a place are even over all of them together, and no block knows of another.
    uint rounds_per_block;
    // Samples that some pixels have beyond `samples`, all together.
    uint extra_samples;
};

struct GoOnPush {
    Draws draws;
    WorkDivision work;
    // That a pixel has.
    uint most_samples;
    uint path_count;
    uint pixel_count;
    uint emitter_count;
    float film_scale;
    float film_limit;
    uint rounding;
};

struct ViewPush {
    Draws draws;
    WorkDivision work;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    uint width;
    uint height;
    // Paths of all pixels, those of each together, and behind them extra samples.
    uint first_path;
    uint end_path;
    vec3 eye;
    vec3 forward;
    // To the picture's right and upper edge: at unit distance, or where parallel rays start.
    vec3 right;
    vec3 up;
    uint is_orthographic;
    // 0: a pinhole.
    float lens_radius;
    // Distance of the plane in focus along the view.
    float focus;
    uint emitter_count;
    // Width of a pixel's filter over the distance between pixels.
    float footprint;
    // Film units in 1 W/m2/sr.
    float film_scale;
    // Largest sum of one pass, film units.
    float film_limit;
};

struct ReceivePush {
    Draws draws;
    WorkDivision work;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    uint first_point;
    uint end_point;
    uint point_count;
    uint emitter_count;
    float film_scale;
    float film_limit;
    // Within which a surface makes a point one of its own.
    float radius;
};

// A hashed grid: cells of a row lie side by side.
struct CellPush {
    vec3 origin;
    float cells_per_unit;
    uint bucket_mask;
    uint photon_capacity;
    // 1: photons that it sorts count as stored; another grid of the same photons has 0.
    uint counts_stored;
};

struct SceneGatherPush {
    WorkDivision work;
    uint first_point;
    uint end_point;
    uint point_count;
    uint pixel_count;
    // Index of the arrival that the map holds, where it holds one only: where its sums stand.
    uint arrival;
    uint round;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    // Of the picture; 0 where points are receivers, in an order of their own.
    uint width;
    uint height;
    // 0: the first slice of candidates of every point; 1: all others of those that have more.
    uint first_slice;
    // Invocations that share a point.
    uint lanes;
    // Of class 0.
    float radius;
    // `GLOBAL_CLASS` or `CAUSTIC_CLASS`, and the classes that this grid serves: `first_class` to `end_class` - 1.
    uint map_class;
    uint first_class;
    uint end_class;
    // Where the map's cuts begin.
    uint first_cut;
    CellPush cells;
};

// Which radius each visible point has, by photons of a trial around it.
struct RadiusClassPush {
    uint first_point;
    uint end_point;
    // `GLOBAL_CLASS` or `CAUSTIC_CLASS`, the first of the classes that this grid serves, and how many there are.
    uint map_class;
    uint first_class;
    uint class_count;
    // Where nothing tells.
    uint usual_class;
    // Of class 0.
    float radius;
    // Photons of the trial within a radius that is to hold as many of a round as wanted.
    float wanted;
    // Of what is clear around a point: larger radii are halved, once or twice.
    float clearance_share;
    // No radius need be smaller than this share of a point's distance from the eye: half a pixel.
    vec3 eye;
    float pixel_share;
    CellPush cells;
};

// Where walls cut the discs of density estimates off.
struct DiscCutsPush {
    WorkDivision work;
    uint first_point;
    uint end_point;
    uint pixel_count;
    // Of the picture; 0 where points are receivers, in an order of their own.
    uint width;
    uint height;
    // Mask of the arrivals that the map holds.
    uint arrivals;
    // `GLOBAL_CLASS` or `CAUSTIC_CLASS`, and where its cuts begin.
    uint map_class;
    uint first_cut;
    // Of class 0.
    float radius;
};

struct FluxToRadiancePush {
    WorkDivision work;
    uint first_point;
    uint end_point;
    uint point_count;
    uint pixel_count;
    // Of the picture; 0 where points are receivers, in an order of their own.
    uint width;
    uint height;
    // Mask of the arrivals that some map holds.
    uint arrivals;
    uint round;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    float film_scale;
    float film_limit;
    // Of class 0.
    float global_radius;
    float caustic_radius;
    // Where the caustic map's cuts begin.
    uint first_caustic_cut;
    // Flux of a photon of relative flux 1, over the photons of the round.
    float global_flux;
    float caustic_flux;
};

struct EndDifferencePush {
    uint row_length;
    uint block;
};

struct ResolvePush {
    WorkDivision work;
    uint first_pixel;
    uint end_pixel;
    uint pixel_count;
    // Visible points of a path that photons may have lit.
    uint points_per_path;
    // Whether what paths find counts.
    uint counts_paths;
    uint block;
    // 1: it is the last round of its block.
    uint ends_block;
};

struct EndRoundPush {
    uint sum_count;
    // Sums of each point.
    uint channel_count;
    uint round;
};

struct CheckPush {
    uint iteration_count;
    uint addend_low;
    uint addend_high;
    uint add_count;
    // Photons of a loop in which lanes vote, and invocations that take them.
    uint photon_count;
    uint stride;
};

// Functions of `glsl/math/math.glsl` at (a, b).
struct MathResults {
    // The bits of a, taken for an integer.
    float converted;
    // a b + a
    float sum_of_product;
    // a / b
    float quotient;
    // Of a.
    float root;
    float inverse_root;
    float exp2;
    float log2;
    // Angle of (b, a).
    float angle;
    float asinh;
};

// What the functions that sample are asked at.
struct SamplingCase {
    // Two random words, as the generator gives them.
    uvec2 words;
    // Of a disc, and of what is made into a frame or packed; a unit vector.
    vec3 normal;
    // Of a lobe.
    float exponent;
    // Unit vectors: corners of a spherical triangle.
    vec3 a;
    vec3 b;
    vec3 c;
};

// What the functions of `glsl/rng/sampling.glsl`, `glsl/world/scene/filter.glsl` and `glsl/world/scene` make of a case.
struct Samples {
    // Around the z axis.
    vec3 cosine_hemisphere;
    vec3 uniform_hemisphere;
    vec3 sphere;
    vec3 lobe;
    // A point of the unit disc around the origin.
    vec3 disc;
    // Barycentric.
    vec2 triangle;
    vec2 filter_offset;
    // A direction within the spherical triangle, and the angle that it was chosen from.
    vec3 in_triangle;
    float solid_angle;
    vec3 tangent;
    vec3 bitangent;
    // The normal, packed in 2 x 16 and in 2 x 15 bits.
    vec3 unpacked_normal;
    vec3 unpacked_direction;
};

// A layered surface as `glsl/check/check_lobes.comp` sees it.
struct LobeCase {
    // Unit vectors: towards the eye, and normals on its side.
    vec3 wo;
    vec3 ng;
    vec3 ns;
    vec3 coat_normal;
    vec3 base_colour;
    float metallic;
    float alpha;
    uint is_stretched;
    float alpha_along;
    vec3 tangent;
    float ior;
    float specular;
    float transmission;
    uint is_solid;
    // Index of refraction where wo is, over that beyond.
    float eta;
    float coat;
    float coat_alpha;
    vec3 sheen;
    float sheen_alpha;
    float diffuse_transmission;
    vec3 diffuse_transmission_colour;
    float iridescence;
    float film_ior;
    float film_thickness;
    float film_bound;
    float coverage;
    // The only lobe that has a chance; NONE: all have.
    uint lobe;
    // Radiance is carried, as by a camera path, and no flux.
    uint carries_radiance;
    // Of random numbers.
    uint seed;
};

// A sample of its lobes, and how they weigh light from there.
struct LobeSample {
    vec3 direction;
    vec3 weight;
    float density;
    uint is_alive;
    uint is_sharp;
    uint passes;
    // The chosen one, where the path does not pass, and its probability.
    uint lobe;
    float chance;
    // BRDF times cosine.
    vec3 matt;
    vec3 sharp;
};

// What `glsl/check/check_packing_...` pack.
struct PackingCase {
    // In the plane of its wall, where it has one.
    vec3 position;
    uint wall;
    // A unit vector.
    vec3 direction;
    uint photon;
    uvec2 stream;
    float flux;
    float weight;
    // Flux of a map's photon, and what one hit adds.
    vec3 colour;
    // Of a normal that is only unpacked.
    uint normal_code;
    Room room;
};

// An entry of the room's photon map and a path, unpacked.
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

// An entry of the map of a scene of triangles, unit vectors packed and unpacked, and a child of a node.
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

// What a window shows of a scene's film; see `glsl/kernels/show_scene.comp`.
struct ShowScenePush {
    uint pixel_count;
    // SHOW_...
    uint shows;
    uint rounds;
    // Whole blocks, and the rounds of these.
    uint blocks;
    uint rounds_of_blocks;
    // W/m2/sr of a film unit.
    float unit;
    // Mean radiance of the picture, of which errors are relative.
    float mean;
};

// The same of the paper's box; see `glsl/kernels/show_room.comp`.
struct ShowRoomPush {
    uint width;
    uint height;
    vec3 eye;
    vec3 forward;
    vec3 right;
    vec3 up;
    uint shows;
    uint channel_count;
    // Texels along each side of a wall, and walls, each with its texels one behind the other.
    uint mesh;
    uint wall_count;
    // Of the box.
    vec3 middle;
    uint rounds;
    // Illumination that a film unit is worth after these rounds, and the mean of what is shown, of which errors are relative.
    float unit;
    float mean;
};

// What is shown, as pixels of a window; see `glsl/kernels/display.comp`.
struct DisplayPush {
    // Of the window, and of what is shown.
    uint width;
    uint height;
    uint shown_width;
    uint shown_height;
    // Pixels of the window along each side of one that is shown.
    uint zoom;
    // Stops by which values are made brighter.
    float stops;
    // 1: values are errors, for false colours.
    uint is_error;
    // 1: values are radiance; 0: the paper's display values.
    uint is_light;
    // 1: the window wants blue first.
    uint blue_first;
};

// Photons of a map as dots; see `glsl/kernels/show_photons.comp`.
struct ShowPhotonsPush {
    uint photon_count;
    uint width;
    uint height;
    uint shown_width;
    uint shown_height;
    uint zoom;
    vec3 eye;
    vec3 forward;
    // To the picture's right and upper edge, as camera rays have them.
    vec3 right;
    vec3 up;
    uint is_orthographic;
    // As the window has it, and pixels along each side of a dot.
    uint colour;
    uint dot_size;
};

// A measurement of a device's limits; see `glsl/kernels/measure_...`.
struct MeasurePush {
    uint item_count;
    // What one invocation does, times over.
    uint step_count;
    // Of random places, which are below a power of two.
    uint mask;
};
