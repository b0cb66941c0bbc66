//! Records that Rust and GLSL share. Twin of `glsl/records.glsl`; `tests/layout.rs` compares the two
//! field by field with what reflection finds in the kernels.
//!
//! Lengths are in metres, directions point along the photon's flight, `flux` is relative: the power
//! of a photon divided by that of the strongest photon of the run (see [`crate::film`]).

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, UVec3, Vec3};

/// One field of a record, as reflection names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    pub name: &'static str,
    pub kind: &'static str,
    pub offset: usize,
}

/// A record's name, size in bytes and fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    pub name: &'static str,
    pub size_bytes: usize,
    pub fields: &'static [Field],
}

/// A Rust type that stands for a GLSL type inside a record.
pub trait GlslType {
    const KIND: &'static str;
}

macro_rules! glsl_types {
    ($($rust:ty => $kind:literal),* $(,)?) => { $(impl GlslType for $rust { const KIND: &'static str = $kind; })* };
}

glsl_types!(f32 => "f32", u32 => "u32", Vec3 => "vec3<f32>", UVec2 => "vec2<u32>", UVec3 => "vec3<u32>");

macro_rules! records {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
            pub struct $name { $($(#[$field_doc])* pub $field: $kind,)* }

            impl GlslType for $name { const KIND: &'static str = stringify!($name); }
        )*

        /// Every record above.
        pub const LAYOUTS: &[Layout] = &[$(Layout {
            name: stringify!($name),
            size_bytes: size_of::<$name>(),
            fields: &[$(Field {
                name: stringify!($field),
                kind: <$kind as GlslType>::KIND,
                offset: std::mem::offset_of!($name, $field),
            }),*],
        }),*];
    };
}

records! {
    /// The axis-aligned room that holds the walls.
    Room {
        min_corner: Vec3,
        max_corner: Vec3,
    }

    /// One face of the room: a diffuse wall, or an opening.
    Wall {
        /// Into the room.
        normal: Vec3,
        /// Share of arriving photons that is reflected.
        albedo: f32,
        tangent: Vec3,
        /// Exponent of the Phong lobe; below 0 the wall is Lambertian.
        shininess: f32,
        bitangent: Vec3,
        /// 1: photons leave the scene here.
        is_open: u32,
    }

    /// A disc of light flush with a wall.
    DiscLight {
        centre: Vec3,
        radius: f32,
        wall: u32,
        /// Relative flux of each of its photons, in (0, 1].
        flux: f32,
    }

    /// A photon in flight.
    Path {
        position: Vec3,
        /// Wall it stands on, or `NO_WALL` once it has died in its slot.
        wall: u32,
        direction: Vec3,
        /// Number within its round.
        photon: u32,
        /// State of its random stream.
        stream: UVec2,
        flux: f32,
    }

    /// A photon where a wall reflected it: one entry of the photon map.
    Photon {
        position: Vec3,
        /// Wall, or `NO_WALL` in an empty slot.
        wall: u32,
        flux: f32,
        /// Phong weight towards the eye, in [0, 1]; 1 on Lambertian walls.
        weight: f32,
        photon: u32,
        bounce: u32,
    }

    /// A photon in grid order: what the gather reads.
    SortedPhoton {
        position: Vec3,
        wall: u32,
        flux: f32,
        weight: f32,
    }

    /// A point at which light is estimated.
    Point {
        position: Vec3,
        wall: u32,
    }

    /// Fates of the paths that entered one bounce.
    Tally {
        stored: u32,
        absorbed: u32,
        escaped: u32,
        dropped: u32,
    }

    /// `VkDispatchIndirectCommand`.
    DispatchArgs {
        x: u32,
        y: u32,
        z: u32,
    }

    /// What a photon's random numbers depend on beside its number.
    RandomKey {
        seed: UVec2,
        round: u32,
        /// Photons of the rounds before this one, mod 2^32; mt seeds by the number in the run.
        photons_before: u32,
        /// rand48: multiplier and increment, 48 bits each, that lead from one draw of a photon to
        /// its next.
        leap_multiplier: UVec2,
        leap_increment: UVec2,
    }

    EmitPush {
        key: RandomKey,
        light: u32,
        first_photon: u32,
        photon_count: u32,
        path_offset: u32,
        /// rand48: from the prepared state of photon i to the first state of photon
        /// `first_photon` + i in this round.
        jump_multiplier: UVec2,
        jump_increment: UVec2,
    }

    TracePush {
        key: RandomKey,
        bounce: u32,
        path_capacity: u32,
        photon_capacity: u32,
        eye: Vec3,
    }

    DispatchSizePush {
        counter: u32,
        capacity: u32,
        items_per_group: u32,
        max_groups: u32,
    }

    IndexPush {
        origin: Vec3,
        cells_per_metre: f32,
        cell_count: UVec3,
        photon_capacity: u32,
    }

    ScanPush {
        item_count: u32,
    }

    GatherPush {
        /// Points `first_point` to `end_point` - 1 and slices from `first_slice` on: what one dispatch
        /// covers.
        first_point: u32,
        end_point: u32,
        first_slice: u32,
        photon_capacity: u32,
        radius_squared: f32,
        /// A little over the radius: how far from the point a cell may lie.
        reach: f32,
        /// Fixed-point units in 1.
        film_scale: f32,
        origin: Vec3,
        cells_per_metre: f32,
        cell_count: UVec3,
    }

    CheckPush {
        iteration_count: u32,
        addend_low: u32,
        addend_high: u32,
        add_count: u32,
    }
}
