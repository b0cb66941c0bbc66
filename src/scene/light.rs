//! Lights that are no mesh.

use glam::{DVec3, Vec3};

#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    pub name: String,
    pub kind: LightKind,
}

#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// Radiant intensity in W/sr, the same in all directions.
    Point { position: DVec3, intensity: Vec3 },
    /// Intensity within the inner cone; it falls smoothly to nothing at the outer one. Angles from
    /// the axis, radians.
    Spot { position: DVec3, direction: DVec3, intensity: Vec3, inner_angle: f32, outer_angle: f32 },
    /// Irradiance in W/m2 on a surface that faces it.
    Directional { direction: DVec3, irradiance: Vec3 },
    /// The same radiance in W/m2/sr from everywhere beyond the scene.
    Environment { radiance: Vec3 },
}

/// Lumens in a watt at 555 nm: what turns glTF's photometric lights into radiometric ones.
pub const LUMENS_PER_WATT: f32 = 683.0;
