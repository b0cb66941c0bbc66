//! Numbers that Rust and GLSL share: `build.rs` includes this file and hands each one to the GLSL
//! compiler as a macro, so that no number is typed twice.

macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident = $value:expr;)*) => {
        $($(#[$doc])* #[allow(dead_code, reason = "some are for GLSL alone")] pub(crate) const $name: u32 = $value;)*
        /// Every constant above, by name, as `build.rs` defines it for GLSL.
        #[allow(dead_code, reason = "build.rs uses it, and tests")]
        pub(crate) const SHARED_WITH_GLSL: &[(&str, u32)] = &[$((stringify!($name), $value)),*];
    };
}

constants! {
    /// Wall id that means "no wall": a dead path, an empty slot of the naive photon map, a gap that several counters left.
    NO_WALL = 0xffff_ffff;
    /// Words between the counters that work groups of the atomic builder use round-robin.
    COUNTER_STRIDE = 64;
    /// Faces of a room, numbered 2 * axis + (1 on the positive side).
    FACE_COUNT = 6;

    /// `RNG`: the 48-bit linear congruential generator of the C library, leap-frogged.
    RNG_RAND48 = 0;
    /// `RNG`: Mersenne Twister MT19937, one seeding a photon.
    RNG_MT = 1;
    /// `RNG`: Philox4x32-10, a counter-based generator.
    RNG_PHILOX = 2;
    /// `RNG`: Owen-scrambled Sobol' points.
    RNG_SOBOL = 3;
    /// Blocks of which some places are kept, and places that are.
    KEPT_BLOCKS = 256;
    KEPT_PLACES = 1024;
    /// Sums of what a smaller radius changes (`engine::error::differences`): blocks whose numbers differ by a multiple of the first share a
    /// row, and each row has so many sums a channel.
    DIFFERENCE_ROWS = 32;
    DIFFERENCE_SUMS = 4096;
    /// Draws of one emission: disc radius, disc angle, cosine, azimuth.
    EMISSION_DRAWS = 4;
    /// Draws of one bounce: roulette, cosine, azimuth.
    BOUNCE_DRAWS = 3;
    /// Last word of Philox's counter: whose random numbers these are. The paper's photons and those of
    /// the global map.
    DOMAIN_PHOTONS = 0;
    DOMAIN_CAUSTIC_PHOTONS = 1;
    DOMAIN_CAMERA = 2;
    DOMAIN_RECEIVERS = 3;
    DOMAIN_LIGHTS = 4;
    /// Philox blocks of an emission in a scene of triangles; bounce b has block `EMISSION_BLOCKS` + b.
    EMISSION_BLOCKS = 2;
    /// Philox blocks of one vertex of a path from the camera: one to go on, the other for light.
    VERTEX_BLOCKS = 2;
    /// Distance between the two state words that one output of MT19937 combines.
    MT_MIDDLE = 397;

    /// `EMISSION_LAW`: radiant intensity equal in all directions of the hemisphere (the paper's words).
    EMISSION_UNIFORM = 0;
    /// `EMISSION_LAW`: Lambertian, intensity proportional to the cosine.
    EMISSION_COSINE = 1;

    /// `PHONG_DIRECTION`: the mirror direction of the arriving photon.
    PHONG_MIRROR = 0;
    /// `PHONG_DIRECTION`: the direction in which the photon was reflected.
    PHONG_SAMPLED = 1;

    /// How a surface scatters; see `scene::Surface`.
    SURFACE_LAMBERT = 0;
    SURFACE_PAPER_PHONG = 1;
    SURFACE_GLOSSY = 2;
    SURFACE_MIRROR = 3;
    SURFACE_DIELECTRIC = 4;
    SURFACE_LAYERED = 6;
    /// No surface: a point that receives, of which irradiance is asked.
    SURFACE_RECEIVER = 5;
    /// GGX lobes with an alpha of so many thousandths or more take part in photon maps; rays follow sharper ones.
    MAP_ALPHA_PER_MILLE = 250;
    /// GGX lobes with an alpha below the inverse are deltas.
    DELTA_ALPHA_INVERSE = 10_000;
    /// How much of a layered surface is there; see `scene::material::Coverage`.
    COVERAGE_WHOLE = 0;
    COVERAGE_MASK = 1;
    COVERAGE_BLEND = 2;
    /// What a texture of a layered material is: a factor, or a normal map.
    LAYER_METALLIC_ROUGHNESS = 0;
    LAYER_SPECULAR = 1;
    LAYER_SPECULAR_COLOUR = 2;
    LAYER_TRANSMISSION = 3;
    LAYER_COAT = 4;
    LAYER_COAT_ROUGHNESS = 5;
    LAYER_COAT_NORMAL = 6;
    LAYER_SHEEN_COLOUR = 7;
    LAYER_SHEEN_ROUGHNESS = 8;
    LAYER_NORMAL = 9;
    LAYER_DIFFUSE_TRANSMISSION = 10;
    LAYER_DIFFUSE_TRANSMISSION_COLOUR = 11;
    LAYER_IRIDESCENCE = 12;
    LAYER_IRIDESCENCE_THICKNESS = 13;
    LAYER_ANISOTROPY = 14;
    LAYER_COUNT = 15;
    /// What a texel's bytes are; see `scene::texture::Texels`.
    TEXELS_SRGB = 0;
    TEXELS_FLOAT = 1;
    TEXELS_LINEAR = 2;
    /// Rows and columns of the tables of directional albedos (`scene::albedo`): roughnesses, and roots of cosines.
    ALBEDO_ROUGHNESSES = 32;
    ALBEDO_COSINES = 64;
    /// A material without a texture, a triangle without smooth normals, a ray without a hit.
    NONE = 0xffff_ffff;
    /// Bit of a triangle's plane: others hide a part of the triangle.
    HIDDEN = 0x8000_0000;
    /// Bit of what stands below a node of the tree of lights: it is an emitter.
    LIGHT_LEAF = 0x8000_0000;
    /// What is nearer to a plane than the inverse lies in it: 16 units in the last place of a coordinate of 0.5, where
    /// normalised scenes end. Rounding of positions and of their heights takes half of that (`glsl/gather/belongs.glsl`).
    IN_PLANE_INVERSE = 2_097_152;

    /// What an emitter is; see `scene::LightKind`.
    EMITTER_TRIANGLE = 0;
    EMITTER_POINT = 1;
    EMITTER_SPOT = 2;
    EMITTER_DIRECTIONAL = 3;
    EMITTER_DISC_COSINE = 4;
    EMITTER_DISC_UNIFORM = 5;
    EMITTER_ENVIRONMENT = 6;

    /// How a photon reached its place, as bits of a mask: straight from the light, over mirrors and
    /// glass alone, or over a surface that scatters.
    ARRIVED_DIRECT = 1;
    ARRIVED_CAUSTIC = 2;
    ARRIVED_INDIRECT = 4;
    /// A caustic over surfaces whose caustics are left out.
    ARRIVED_UNWANTED = 8;

    /// Parts of a picture, as bits of a mask.
    PART_DIRECT = 1;
    PART_SPECULAR = 2;
    PART_CAUSTIC = 4;
    PART_INDIRECT = 8;
    PART_COUNT = 4;
    /// What a window shows: all light, one of its parts, or the standard error over the mean of the picture.
    SHOW_ALL = 0;
    SHOW_DIRECT = 1;
    SHOW_SPECULAR = 2;
    SHOW_CAUSTIC = 3;
    SHOW_INDIRECT = 4;
    SHOW_ERROR = 5;
    /// Kinds of chances by which light may reach a pixel.
    HIT_SHADOW_RAY = 0;
    HIT_CAUSTIC_PHOTON = 1;
    HIT_GLOBAL_PHOTON = 2;
    /// Shadow rays to lights that the trial did not see from there.
    HIT_UNSEEN_LIGHT = 3;
    /// Photons of the global map that are not dim.
    HIT_BRIGHT_PHOTON = 4;
    /// No light: the receiver lies on no surface, where photons could be counted.
    HIT_OFF_SURFACE = 5;
    HIT_KINDS = 6;
    /// What a point gathers in a round is dim where it is less than the inverse of this, of the flux of the brightest photon.
    DIM_PHOTONS = 16;

    /// Bits of a visible point's arrivals: it lies behind a mirror or glass, or behind a gather ray; or neither, so that
    /// one of a pixel's samples looks the global map up for all (each looks caustics up for itself).
    SEEN_OVER_SPECULAR = 256;
    SEEN_BY_GATHER = 512;
    SEEN_FOR_ALL = 1024;
    /// There is a visible point, whatever is asked of it.
    SEEN = 2048;
    /// 128 MiB, the least that devices promise of one buffer.
    TEXELS_PER_BUFFER = 33_554_432;

    /// Openings, at most, that shadow rays and photons from beyond the scene are aimed at.
    MAX_OPENINGS = 8;

    /// `GATHER_RAYS`: which visible points take their indirect light from a ray of a final gather.
    GATHER_NONE = 0;
    GATHER_GLOSSY = 1;
    GATHER_ALL = 2;

    /// `KERNEL`: weight of a photon by its distance.
    KERNEL_BOX = 0;
    KERNEL_CONE = 1;
    KERNEL_EPANECHNIKOV = 2;

    /// `FILTER`: how a pixel weighs the picture around it.
    FILTER_BOX = 0;
    FILTER_TENT = 1;
    FILTER_GAUSSIAN = 2;

    /// What `--paranoid` found odd: a photon, light at a point, a density estimate there.
    NONFINITE_PHOTON = 0;
    NONFINITE_LIGHT = 1;
    NONFINITE_ESTIMATE = 2;
    /// Odd values of which the owner is written down.
    MAX_NONFINITE_VALUES = 64;

    /// `SUMS`: 64-bit fixed point.
    SUMS_INTEGER = 0;
    /// `SUMS`: a 32-bit float in the low word.
    SUMS_F32 = 1;
    /// `SUMS`: a 32-bit float in the low word, what its rounding lost in the high word.
    SUMS_COMPENSATED = 2;

    /// Most that a shading normal may change a photon's flux by, all bounces together.
    MAX_SHADING_GAIN = 8;
    /// Bounces after which any path ends: of a photon, and of a camera path over mirrors and glass. Roulette ends nearly all of
    /// them long before; what it leaves is counted as cut off.
    MAX_BOUNCES = 10_000;
    /// Mirrors and panes of glass after which roulette may end a camera path in proportion to what it still carries, and after
    /// which it may end any: a path that lossless glass traps would cost as much time as a whole round.
    ROULETTE_DEPTH = 32;
    LOSSLESS_DEPTH = 128;
    /// Surfaces of a path after which a smooth normal alone makes no total reflection in glass: coarse facets would catch
    /// light that the smooth shape lets out.
    SMOOTH_TOTAL_REFLECTIONS = 8;
    /// Bounces of a scene's photons of which fates are counted apart; the last count takes in all later ones.
    TALLY_ROWS = 64;
    /// Words of one copy of a map's totals (`glsl/ledger/totals.glsl`), and the bits of flux after the binary point.
    TOTAL_WORDS = 16;
    TOTAL_FLUX_BITS = 20;
    /// Entries of the stack that traverses the bounding volume hierarchy.
    BVH_STACK = 32;

    /// Most loop iterations that one invocation may do in one dispatch. lavapipe leaves its loops
    /// without a word after 65 535 iterations over all loops of a shader.
    LOOP_LIMIT = 16_384;
    /// Photons that one invocation of a gather tests; a longer list is shared by several invocations.
    GATHER_SLICE = 4_096;
    /// Classes of radii that the points of a map may have, each half of the one before it; and classes that one grid serves.
    RADIUS_CLASSES = 16;
    CLASSES_OF_GRID = 2;
    /// What stands for the class of a point that is not known yet: 8 bits of it.
    NO_CLASS = 0xff;
    /// No radius is below 2 to the power of minus this, of the scene's normalised extent.
    LEAST_RADIUS_BITS = 15;
    /// Photons of the trial around a point that give their density there.
    CLASS_PHOTONS = 8;
    /// Photons of a leaf of the kd-tree.
    TREE_LEAF = 8;
    /// Photons that one invocation of the tree's radix sort counts or moves, in their order.
    TREE_RUN = 16;
    /// Values of a digit of that sort: 4 bits of a coordinate, or a wall.
    TREE_RADIX = 16;
    /// Digits of a coordinate, the lowest first; after them the wall.
    TREE_DIGITS = 8;
    /// Bits after the binary point of the flux of a point's nearest photons. With 10 bits of photons and the 24
    /// of a factor they fit 62.
    NEAREST_BITS = 28;
    /// Most photons that `--nearest` may ask for.
    MAX_NEAREST = 1_024;
    /// log2 of the most by which the flux of the nearest photons is scaled up to the full radius: their disc is
    /// taken for 1 / 1024 of the radius at least, and one in a corner loses three quarters.
    NEAREST_GAIN_BITS = 22;
    /// Work groups along an axis that every device allows.
    MAX_GROUPS = 65_535;
    /// Bounces whose fates a work group counts in its own memory.
    GROUP_TALLIES = 32;
    /// Paths that an invocation takes through a bounce where subgroups or work groups take places for them together.
    PATHS_TOGETHER = 2;
    /// Copies of each tally on the device, so that work groups do not wait for each other at one.
    TALLY_COPIES = 64;
    /// Items that one invocation of the prefix sum handles.
    SCAN_ITEMS = 4;
    /// Subgroups that a work group can hold at most: 1024 invocations in subgroups of one.
    MAX_SUBGROUPS = 1_024;
}
