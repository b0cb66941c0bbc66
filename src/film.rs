//! The film: what every point has received, in integers unless the run asks otherwise, so that it does
//! not matter in which order photons, chunks, rounds or devices add to it.

use std::f64::consts::PI;

use crate::plan::Plan;
use crate::scene::room::RoomScene;
use crate::settings::Sums;

/// Sums of a run, point by point, and what they are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// `channel_count` sums a point, in fixed-point units: relative flux, then the paper's illumination
    /// power (photons within the radius times their Phong weight). With one channel the two are the same. With
    /// `--nearest` it is what the disc of the radius would hold at the density of the nearest photons.
    pub sums: Vec<u64>,
    /// What the bits of a sum mean.
    pub kind: Sums,
    pub channel_count: u32,
    /// Fixed-point units in 1.
    pub scale: f64,
    /// Photons emitted so far.
    pub emitted: u64,
}

impl Film {
    pub fn new(plan: &Plan, sums: Vec<u64>, emitted: u64) -> Film {
        Film { sums, kind: plan.settings.sums, channel_count: plan.channel_count, scale: plan.film_scale(), emitted }
    }

    pub fn point_count(&self) -> usize {
        self.sums.len() / self.channel_count as usize
    }

    /// A sum in fixed-point units.
    pub fn units(&self, sum: usize) -> f64 {
        let bits = self.sums[sum];
        let float = |word: u64| f64::from(f32::from_bits(word as u32));
        match self.kind {
            Sums::Integer => bits as f64,
            Sums::F32 => float(bits),
            Sums::Compensated => float(bits) + float(bits >> 32),
        }
    }

    /// Relative flux within the radius of a point.
    pub fn flux(&self, point: usize) -> f64 {
        self.units(point * self.channel_count as usize) / self.scale
    }

    /// The paper's photon power within the radius of a point.
    pub fn power(&self, point: usize) -> f64 {
        let last = self.channel_count as usize - 1;
        self.units(point * self.channel_count as usize + last) / self.scale
    }
}

/// One wall of the result: its texels row by row, column i along u, row j along v.
#[derive(Debug, Clone, PartialEq)]
pub struct WallEstimate {
    pub name: &'static str,
    pub face: usize,
    /// Photon power over full light, not clamped: the paper shows 1 and more as full.
    pub illumination: Vec<f64>,
    /// Reflected flux an area, W/m2: what the stored photons, all of them reflected, estimate.
    pub radiosity: Vec<f64>,
    /// Arriving flux an area, W/m2: radiosity over albedo.
    pub irradiance: Vec<f64>,
}

/// Reads the film as the paper's illumination and in physical units.
///
/// The radiosity of a point is the flux of the photons stored within the radius over the area in
/// which they were looked for: with edge correction the part of the disc that lies on the wall,
/// without it the whole disc, which is dark along edges.
pub fn estimate_walls(film: &Film, scene: &RoomScene, plan: &Plan) -> Vec<WallEstimate> {
    let settings = &plan.settings;
    let mesh = settings.mesh as usize;
    // A film without photons is dark, not undefined.
    let emitted = film.emitted.max(1) as f64;
    let rounds = emitted / f64::from(settings.photons);
    let watts = plan.flux_unit / emitted;
    let disc = PI * settings.radius * settings.radius;
    scene
        .walls()
        .enumerate()
        .map(|(place, (face, wall))| {
            let rectangle = scene.rectangle(face);
            let first = place * mesh * mesh;
            let radiosity: Vec<f64> = (0..mesh * mesh)
                .map(|texel| {
                    let (s, t) = ((texel % mesh) as f64 + 0.5, (texel / mesh) as f64 + 0.5);
                    let area = if settings.edge_correction {
                        rectangle.covered_area(s / mesh as f64, t / mesh as f64, settings.radius)
                    } else {
                        disc
                    };
                    film.flux(first + texel) * watts / area
                })
                .collect();
            WallEstimate {
                name: wall.name,
                face,
                illumination: (0..mesh * mesh).map(|texel| film.power(first + texel) / (settings.full_light * rounds)).collect(),
                irradiance: radiosity.iter().map(|radiosity| radiosity / f64::from(wall.albedo)).collect(),
                radiosity,
            }
        })
        .collect()
}
