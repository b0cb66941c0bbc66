//! Numbers that Rust and GLSL share: `build.rs` includes this file and hands each one to the GLSL
//! compiler as a macro, so that no number is typed twice.

macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: u32 = $value;)*
        /// Every constant above, by name, as `build.rs` defines it for GLSL.
        pub const SHARED_WITH_GLSL: &[(&str, u32)] = &[$((stringify!($name), $value)),*];
    };
}

constants! {
    /// Wall id that means "no wall": a dead path, an empty slot of the naive photon map.
    NO_WALL = 0xffff_ffff;
    /// Faces of a room, numbered 2 * axis + (1 on the positive side).
    FACE_COUNT = 6;

    /// `RNG`: the 48-bit linear congruential generator of the C library, leap-frogged.
    RNG_RAND48 = 0;
    /// `RNG`: Mersenne Twister MT19937, one seeding a photon.
    RNG_MT = 1;
    /// `RNG`: Philox4x32-10, a counter-based generator.
    RNG_PHILOX = 2;
    /// Draws of one emission: disc radius, disc angle, cosine, azimuth.
    EMISSION_DRAWS = 4;
    /// Draws of one bounce: roulette, cosine, azimuth.
    BOUNCE_DRAWS = 3;
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

    /// Most loop iterations that one invocation may do in one dispatch. lavapipe leaves its loops
    /// without a word after 65 535 iterations over all loops of a shader.
    LOOP_LIMIT = 16_384;
    /// Photons that one invocation of a gather tests; a longer list is shared by several invocations.
    GATHER_SLICE = 4_096;
    /// Items that one invocation of the prefix sum handles.
    SCAN_ITEMS = 4;
    /// Subgroups that a work group can hold at most: 1024 invocations in subgroups of one.
    MAX_SUBGROUPS = 1_024;
}
