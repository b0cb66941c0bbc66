//! Records that Rust and GLSL share, in `scalar` layout: the structs of buffers and push constants, which build.rs finds by reflection
//! and takes with their comments from the GLSL. `tests/engine/layout.rs` compares the two field by field with what reflection finds.
//!
//! Lengths are in metres, directions point along the photon's flight, `flux` is relative: the power
//! of a photon divided by that of the strongest photon of the run (see [`crate::engine::room::film`]).

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, UVec3, Vec2, Vec3};

use crate::constants::MAX_GROUPS;

/// One field of a record, as reflection names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Field {
    pub name: &'static str,
    pub kind: &'static str,
    pub offset: usize,
}

/// A record's name, size in bytes and fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    pub name: &'static str,
    pub size_bytes: usize,
    pub fields: &'static [Field],
}

/// A Rust type that stands for a GLSL type inside a record.
pub(crate) trait GlslType {
    const KIND: &'static str;
}

macro_rules! glsl_types {
    ($($rust:ty => $kind:literal),* $(,)?) => { $(impl GlslType for $rust { const KIND: &'static str = $kind; })* };
}

glsl_types!(f32 => "f32", u32 => "u32", Vec2 => "vec2<f32>", Vec3 => "vec3<f32>", UVec2 => "vec2<u32>", UVec3 => "vec3<u32>");

macro_rules! records {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
            pub(crate) struct $name { $($(#[$field_doc])* pub(crate) $field: $kind,)* }

            impl GlslType for $name { const KIND: &'static str = stringify!($name); }
        )*

        /// Every record.
        #[allow(dead_code, reason = "tests compare it with GLSL")]
        pub(crate) const LAYOUTS: &[Layout] = &[$(Layout {
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

include!(concat!(env!("OUT_DIR"), "/records.rs"));

impl DispatchSizePush {
    /// An invocation for each of what a counter counts, `capacity` at most.
    pub(crate) fn new(counter: u32, capacity: u32, items_per_group: u32) -> DispatchSizePush {
        DispatchSizePush { counter, capacity, items_per_group, max_groups: MAX_GROUPS }
    }
}
