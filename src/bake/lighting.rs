//! Between a layout and the light: how fine it is by default, the points that are asked about, and what a run found there.

use super::{Layout, PHASE_COUNT, TexelEstimate};
use crate::engine::scene::RunResult;
use crate::error::{Error, Result};
use crate::output::colour::ColourImage;
use crate::records::Receiver;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;

/// Texels of all maps together, unless the user asks for a density.
const USUAL_TEXELS: f64 = 65_536.0;

/// Texels per metre; fails where there is nothing to bake in the scene of this name.
pub(crate) fn usual_density(scene: &Scene, name: &str) -> Result<f64> {
    let kinds = scene.lobe_kinds();
    let baked = scene.meshes.iter().filter(|mesh| kinds[mesh.material].rough);
    let area: f64 = baked.map(super::super::scene::mesh::Mesh::whole_area).sum();
    if area == 0.0 {
        let reason =
            "has nothing to bake: every surface is a mirror, lets light through or is unlit, or has no area; add one that scatters light";
        return Err(Error::Scene { path: name.into(), object: "the scene".into(), reason: reason.into() });
    }
    Ok((USUAL_TEXELS / area).sqrt())
}

impl Layout {
    /// The points that each round of so many asks about: one of every texel, another one each time.
    pub(crate) fn receivers(&self, rounds: u32, geometry: &Geometry) -> Vec<Vec<Receiver>> {
        let of_phase = |phase: usize| {
            let receiver = |sample: &super::TexelSample| Receiver {
                position: geometry.to_local(sample.position),
                normal: sample.geometric_normal.as_vec3(),
                shading_normal: sample.shading_normal.as_vec3(),
            };
            self.phase(phase).iter().map(receiver).collect()
        };
        (0..PHASE_COUNT.min(rounds as usize)).map(of_phase).collect()
    }
}

/// What a run found for every texel.
pub(crate) fn estimates(result: &RunResult) -> Vec<TexelEstimate> {
    let (errors, unseen) = (result.film.stated_errors(), result.film.unseen_bounds());
    let estimate = |texel: usize| TexelEstimate {
        irradiance: result.film.mean(texel).as_vec3(),
        standard_error: errors(texel).as_vec3(),
        unseen: unseen(texel) as f32,
    };
    (0..result.film.pixels()).map(estimate).collect()
}

/// Stops that make the mean of white surfaces middle grey.
pub(crate) fn usual_exposure(estimates: &[TexelEstimate]) -> f32 {
    let pixels = estimates.iter().map(|estimate| estimate.irradiance / std::f32::consts::PI).collect();
    ColourImage { width: estimates.len() as u32, height: 1, pixels }.usual_exposure()
}
