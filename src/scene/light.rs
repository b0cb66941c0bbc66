//! Lights that are no mesh.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::sky::Sky;
use crate::constants::*;
use crate::settings::EmissionLaw;

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
    /// A disc that emits to the side of its unit normal, `power` watts in all. It neither blocks light
    /// nor is seen itself, as the lamps in the walls of the paper's box.
    Disc { centre: DVec3, normal: DVec3, radius: f64, power: Vec3, law: EmissionLaw },
    /// The same radiance in W/m2/sr from everywhere beyond the scene.
    Environment { radiance: Vec3 },
    /// Radiance from beyond the scene by a picture; a scene has at most one, and no other environment beside it.
    Sky(Arc<Sky>),
}

/// Lumens in a watt at 555 nm: what turns glTF's photometric lights into radiometric ones.
pub(crate) const LUMENS_PER_WATT: f32 = 683.0;

impl LightKind {
    /// Whether it emits from beyond the scene, in all directions.
    pub fn is_environment(&self) -> bool {
        matches!(self, LightKind::Environment { .. } | LightKind::Sky(_))
    }

    /// `EMITTER_...`.
    pub fn code(&self) -> u32 {
        match self {
            LightKind::Point { .. } => EMITTER_POINT,
            LightKind::Spot { .. } => EMITTER_SPOT,
            LightKind::Directional { .. } => EMITTER_DIRECTIONAL,
            LightKind::Disc { law: EmissionLaw::Cosine, .. } => EMITTER_DISC_COSINE,
            LightKind::Disc { law: EmissionLaw::Uniform, .. } => EMITTER_DISC_UNIFORM,
            LightKind::Environment { .. } | LightKind::Sky(_) => EMITTER_ENVIRONMENT,
        }
    }
}
