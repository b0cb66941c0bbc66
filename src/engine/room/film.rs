//! The film of the paper's box: sums of every point with their standard errors, in integers unless the run asks otherwise, and the
//! irradiance and radiosity made of them.

use std::f64::consts::PI;
use std::ops::{Deref, DerefMut};

use crate::engine::error_bound::FilmError;
use crate::engine::film::RoundSums;
use crate::engine::unknown::{Unknown, most_hits};
use crate::plan::RoomPlan;
use crate::plan::latest_rounds::kept_values;
use crate::scene::room::RoomScene;
use crate::settings::Sums;

/// Sums of a run, point by point, and what they are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomFilm {
    /// `channel_count` sums a point, in fixed-point units: relative flux, then the paper's illumination
    /// power (photons within the radius times their Phong weight). With one channel the two are the same. With
    /// `--nearest` it is what the disc of the radius would hold at the density of the nearest photons. No squares of a run
    /// of a single round.
    pub of_rounds: RoundSums,
    /// What the bits of a sum mean.
    pub kind: Sums,
    /// What of the sums a round left that was ended in its middle. Such a round counts in the mean, and in no error, as
    /// less light is in it than in others. Empty where every round is whole.
    pub unfinished: Vec<u64>,
    pub channel_count: u32,
    /// Fixed-point units in 1.
    pub scale: f64,
    /// Photons emitted so far, and in a whole round.
    pub emitted: u64,
    pub photons_per_round: u32,
}

impl Deref for RoomFilm {
    type Target = RoundSums;

    fn deref(&self) -> &RoundSums {
        &self.of_rounds
    }
}

impl DerefMut for RoomFilm {
    fn deref_mut(&mut self) -> &mut RoundSums {
        &mut self.of_rounds
    }
}

impl RoomFilm {
    /// Of no photon.
    pub fn new(plan: &RoomPlan) -> RoomFilm {
        let count = plan.points.len() * plan.channel_count as usize;
        let squares = if plan.keeps_squares() { vec![0; count] } else { Vec::new() };
        let latest = if plan.keeps_squares() { vec![0.0; kept_values(plan.points.len(), plan.settings.rounds)] } else { Vec::new() };
        RoomFilm {
            of_rounds: RoundSums { rounds: 0, sums: vec![0; count], squares, latest },
            unfinished: Vec::new(),
            kind: plan.settings.sums,
            channel_count: plan.channel_count,
            scale: plan.film_scale(),
            emitted: 0,
            photons_per_round: plan.settings.photons,
        }
    }

    /// Adds what a whole round left, and empties it for the next. Twin of `glsl/kernels/end_round.comp`. Sums of floats
    /// go on over all rounds instead, as their additions are what is looked at.
    pub fn end_round(&mut self, of_round: &mut [u64]) {
        if self.kind != Sums::Integer {
            self.rounds += 1;
            self.sums.copy_from_slice(of_round);
            return;
        }
        self.of_rounds.end_round(of_round, self.channel_count as usize);
        of_round.fill(0);
    }

    /// Adds what a round left that will not be finished.
    pub fn add_unfinished(&mut self, part: Vec<u64>) {
        if self.kind != Sums::Integer {
            self.sums = part;
            return;
        }
        self.sums.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
        self.unfinished = part;
    }

    /// Standard error of [`RoomFilm::flux`], from the variance between rounds; infinite where fewer than two are whole.
    pub fn flux_error(&self, point: usize) -> f64 {
        let place = point * self.channel_count as usize;
        let sum = self.sums[place] - self.unfinished.get(place).copied().unwrap_or(0);
        let of_mean = self.variance(place, sum).sqrt() / f64::from(self.rounds) / self.scale;
        of_mean * self.emitted as f64 / f64::from(self.photons_per_round)
    }

    /// Root mean square over points of the standard error of irradiance, over that of irradiance. `weights` are
    /// [`irradiance_weights`].
    pub fn relative_error(&self, weights: &[f64]) -> f64 {
        let square_sum = |of_point: &dyn Fn(usize) -> f64| -> f64 {
            weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0).map(|(point, weight)| (weight * of_point(point)).powi(2)).sum()
        };
        let means = square_sum(&|point| self.flux(point));
        if means > 0.0 { (square_sum(&|point| self.flux_error(point)) / means).sqrt() } else { 0.0 }
    }

    /// What it tells of its error; `unit` makes W/m2 of flux times weight.
    pub fn error(&self, weights: &[f64], unit: f64, confidence: f64) -> FilmError {
        FilmError {
            rounds: self.rounds,
            noise: self.relative_error(weights),
            freedom: self.degrees_of_freedom(1, weights.len(), |point| weights[point]),
            unknown: self.unknown(weights, unit, confidence),
            unseen: 0.0,
        }
    }

    /// Points of walls that reflect, but where no photon was stored: what is known of them is a bound. Of relative flux, a
    /// photon has 1 at most; `unit` makes W/m2 of flux times weight.
    pub fn unknown(&self, weights: &[f64], unit: f64, confidence: f64) -> Unknown {
        let mut unknown = Unknown { asked: weights.iter().filter(|weight| **weight > 0.0).count() as u64, ..Unknown::default() };
        let (mut bounds, mut result) = (0.0, 0.0);
        for (point, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            result += (weight * self.flux(point)).powi(2);
            if self.is_unreached(point) {
                let most = weight * most_hits(confidence);
                unknown.add_unreached(unit * most);
                bounds += most * most;
            }
        }
        unknown.relative_to(bounds, result)
    }

    /// [`RoomFilm::flux_error`], but infinite where nothing was found on a wall that reflects.
    fn stated_error(&self, point: usize, albedo: f32) -> f64 {
        if albedo > 0.0 && self.is_unreached(point) { f64::INFINITY } else { self.flux_error(point) }
    }

    /// Whether no photon was found at a point.
    pub fn is_unreached(&self, point: usize) -> bool {
        self.units(point * self.channel_count as usize) == 0.0
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
    /// Their standard errors, W/m2; infinite where fewer than two rounds are whole, and where no photon was found.
    pub radiosity_error: Vec<f64>,
    pub irradiance_error: Vec<f64>,
}

/// Areas in which photons were looked for, m2, point by point.
fn areas(scene: &RoomScene, plan: &RoomPlan) -> Vec<f64> {
    let settings = &plan.settings;
    let mesh = settings.mesh as usize;
    let disc = PI * settings.radius * settings.radius;
    let of_texel = |face: usize, texel: usize| {
        if !settings.edge_correction {
            return disc;
        }
        let (s, t) = ((texel % mesh) as f64 + 0.5, (texel / mesh) as f64 + 0.5);
        scene.rectangle(face).covered_area(s / mesh as f64, t / mesh as f64, settings.radius)
    };
    scene
        .walls()
        .flat_map(|(face, _)| (0..mesh * mesh).map(move |texel| (face, texel)))
        .map(|(face, texel)| of_texel(face, texel))
        .collect()
}

/// What a unit of flux at each point is worth in irradiance, but for what all points share; 0 where a wall reflects
/// nothing, and its photons are not stored.
pub fn irradiance_weights(scene: &RoomScene, plan: &RoomPlan) -> Vec<f64> {
    let albedo = |point: usize| scene.faces[plan.points[point].wall as usize].as_ref().map_or(0.0, |wall| f64::from(wall.albedo));
    let weight = |(point, area): (usize, f64)| if albedo(point) > 0.0 { 1.0 / (area * albedo(point)) } else { 0.0 };
    areas(scene, plan).into_iter().enumerate().map(weight).collect()
}

/// Reads the film as the paper's illumination and in physical units.
///
/// The radiosity of a point is the flux of the photons stored within the radius over the area in
/// which they were looked for: with edge correction the part of the disc that lies on the wall,
/// without it the whole disc, which is dark along edges.
pub fn estimate_walls(film: &RoomFilm, scene: &RoomScene, plan: &RoomPlan) -> Vec<WallEstimate> {
    let settings = &plan.settings;
    let mesh = settings.mesh as usize;
    // A film without photons is dark, not undefined.
    let emitted = film.emitted.max(1) as f64;
    let rounds = emitted / f64::from(settings.photons);
    let watts = plan.flux_unit / emitted;
    let areas = areas(scene, plan);
    scene
        .walls()
        .enumerate()
        .map(|(place, (face, wall))| {
            let first = place * mesh * mesh;
            let density = |flux: &dyn Fn(usize) -> f64| -> Vec<f64> {
                (first..first + mesh * mesh).map(|point| flux(point) * watts / areas[point]).collect()
            };
            let (radiosity, radiosity_error) =
                (density(&|point| film.flux(point)), density(&|point| film.stated_error(point, wall.albedo)));
            let over_albedo = |values: &[f64]| values.iter().map(|value| value / f64::from(wall.albedo)).collect();
            WallEstimate {
                name: wall.name,
                face,
                illumination: (0..mesh * mesh).map(|texel| film.power(first + texel) / (settings.full_light * rounds)).collect(),
                irradiance: over_albedo(&radiosity),
                irradiance_error: over_albedo(&radiosity_error),
                radiosity,
                radiosity_error,
            }
        })
        .collect()
}
