//! Normalised places: lengths in a unit that is a power of two, so that scaling a scene by one changes no bit.

use glam::{DVec3, Vec3};

use super::Scene;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    /// Lowest and highest corner of the scene, metres.
    pub bounds: (DVec3, DVec3),
    pub centre: DVec3,
    /// Metres in a normalised length of 1.
    pub unit: f64,
}

impl Frame {
    /// Every coordinate of the scene lies within (-1, 1). An error says what is wrong with its size.
    pub(crate) fn of(scene: &Scene) -> Result<Frame, String> {
        let (min, max) = scene.bounds();
        let extent = (max - min).max_element();
        if !(extent.is_normal() && extent < 1e30) {
            return Err(format!("is {extent} metres wide; allowed is anything above 0 and below 1e30"));
        }
        Ok(Frame { bounds: (min, max), centre: 0.5 * (min + max), unit: 2f64.powi(extent.log2().ceil() as i32) })
    }

    pub(crate) fn local(&self, position: DVec3) -> Vec3 {
        ((position - self.centre) / self.unit).as_vec3()
    }
}

/// What f32 makes a line of cannot be hit, and its normal would be no number; on a device that takes numbers without a leading 1 for
/// nothing, neither would that of a square below the least normal one.
pub(crate) fn has_area([a, b, c]: &[Vec3; 3]) -> bool {
    (*b - *a).cross(*c - *a).length_squared() >= f32::MIN_POSITIVE
}
