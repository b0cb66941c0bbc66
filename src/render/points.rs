//! The light at points.

use glam::DVec3;

use super::checkpoints::Checkpoints;
use super::events::Observer;
use super::prepare::{Inputs, RequestedReceivers, Run};
use super::request::RenderRequest;
use super::scene::PreparedScene;
use crate::error::{Result, require};
use crate::gpu::Gpu;

/// Points of one run at most: their numbers are 32-bit.
pub const MAX_POINTS: usize = 1 << 28;
/// Metres: the square of anything larger would leave f32's range once normalised.
const MAX_COORDINATE: f64 = 1e15;

/// A point and the normal of its surface, of any length but 0; fails with what is wrong with them.
pub fn point_of(position: [f64; 3], normal: [f64; 3]) -> std::result::Result<(DVec3, DVec3), String> {
    if let Some(value) = position.iter().chain(&normal).find(|value| value.is_nan() || value.abs() > MAX_COORDINATE) {
        return Err(format!("holds {value}; numbers must be from -{MAX_COORDINATE:e} to {MAX_COORDINATE:e}"));
    }
    let normal = DVec3::from(normal);
    if normal == DVec3::ZERO {
        return Err("has a normal of length 0".to_owned());
    }
    Ok((DVec3::from(position), (normal / normal.abs().max_element()).normalize()))
}

impl PreparedScene {
    /// The irradiance at points with the normals of their surfaces, metres.
    pub fn probe(&self, gpus: &mut Vec<Gpu>, points: &[(DVec3, DVec3)], request: &RenderRequest, observer: &Observer) -> Result<Run> {
        let allowed = format!("must be from 1 to {MAX_POINTS}, the number of points");
        require((1..=MAX_POINTS).contains(&points.len()), "points", points.len(), allowed)?;
        let inputs = Inputs::open(request)?;
        let mut checkpoints = Checkpoints::open(request, observer)?;
        let run = self.prepare(inputs, RequestedReceivers::Points(points), observer)?.run(gpus, &mut checkpoints, observer)?;
        checkpoints.finish()?;
        Ok(run)
    }
}
