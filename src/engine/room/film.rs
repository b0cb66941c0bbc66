//! The film of the paper's box: sums of every point with their standard errors, in integers unless the run asks otherwise, and the
//! irradiance and radiosity made of them.

use std::f64::consts::PI;
use std::ops::{Deref, DerefMut};

use crate::engine::error::bound::FilmError;
use crate::engine::error::measure::ErrorMeasure;
use crate::engine::error::unknown::{Unknown, most_hits};
use crate::engine::film::{BlockSums, KeptBlock, LatestBlocks, TooLarge, kept_value};
use crate::plan::RoomPlan;
use crate::plan::latest_blocks::{kept_count, kept_place};
use crate::scene::room::RoomScene;
use crate::settings::Sums;
use crate::settings::stop::{LEAST_BLOCKS, Measure, Stop};

/// Sums of a run, point by point, and what they are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomFilm {
    /// `channel_count` sums a point, in fixed-point units: relative flux, then the paper's illumination
    /// power (photons within the radius times their Phong weight). With one channel the two are the same. With
    /// `--nearest` it is what the disc of the radius would hold at the density of the nearest photons. A block is a round. No squares
    /// of a run of a single one.
    pub of_blocks: BlockSums,
    /// Of relative flux.
    pub(crate) latest: LatestBlocks,
    /// What the bits of a sum mean.
    pub kind: Sums,
    pub channel_count: u32,
    /// Fixed-point units in 1.
    pub scale: f64,
    /// Photons whose light it holds, and those of a round.
    pub emitted: u64,
    pub photons_per_round: u32,
}

impl Deref for RoomFilm {
    type Target = BlockSums;

    fn deref(&self) -> &BlockSums {
        &self.of_blocks
    }
}

impl DerefMut for RoomFilm {
    fn deref_mut(&mut self) -> &mut BlockSums {
        &mut self.of_blocks
    }
}

impl RoomFilm {
    /// Of no photon.
    pub(crate) fn new(plan: &RoomPlan) -> RoomFilm {
        let count = plan.points.len() * plan.channel_count as usize;
        let squares = if plan.keeps_squares() { vec![0; count] } else { Vec::new() };
        RoomFilm {
            of_blocks: BlockSums { rounds: 0, blocks: 0, sums: vec![0; count], squares },
            latest: LatestBlocks::default(),
            kind: plan.settings.sums,
            channel_count: plan.channel_count,
            scale: plan.film_scale(),
            emitted: 0,
            photons_per_round: plan.settings.photons,
        }
    }

    /// Adds what a whole round left, and empties it for the next. Twin of `glsl/kernels/end_round.comp`. Sums of floats
    /// go on over all rounds instead, as their additions are what is looked at.
    pub(crate) fn end_round(&mut self, number: u32, of_round: &mut [u64]) {
        if self.kind != Sums::Integer {
            self.rounds += 1;
            self.blocks += 1;
            self.sums.copy_from_slice(of_round);
            return;
        }
        self.of_blocks.end_block(1, of_round);
        if !self.squares.is_empty() {
            let (channels, places) = (self.channel_count as usize, self.point_count());
            let values = (0..kept_count(places)).map(|k| kept_place(k, places).map_or(0.0, |place| kept_value(of_round[place * channels])));
            let values = values.collect();
            self.latest.push(KeptBlock { number, values });
        }
        of_round.fill(0);
    }

    /// Adds the rounds of another part of the same run.
    pub(crate) fn merge(&mut self, other: &RoomFilm) -> Result<(), TooLarge> {
        self.of_blocks.merge(&other.of_blocks)?;
        self.latest.merge(&other.latest);
        self.emitted = self.emitted.checked_add(other.emitted).ok_or(TooLarge)?;
        Ok(())
    }

    /// Standard error of [`RoomFilm::flux`], from the variance between rounds; infinite where fewer than two are whole.
    pub(crate) fn flux_error(&self, point: usize) -> f64 {
        let place = point * self.channel_count as usize;
        self.variance(place).sqrt() / self.scale
    }

    /// How errors of irradiance add up. `weights` are [`irradiance_weights`].
    fn measure(&self, weights: &[f64], measure: Measure) -> ErrorMeasure {
        let sum = weights.iter().enumerate().map(|(point, weight)| weight * self.flux(point)).sum();
        ErrorMeasure::new(measure, weights.iter().filter(|weight| **weight > 0.0).count() as f64, sum)
    }

    /// Relative error of irradiance, as the measure adds it up. `weights` are [`irradiance_weights`].
    pub(crate) fn relative_error(&self, weights: &[f64], measure: Measure) -> f64 {
        let measure = self.measure(weights, measure);
        let of_point = |(point, weight): (usize, &f64)| measure.relative(weight * self.flux_error(point), weight * self.flux(point));
        weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0).map(|point| of_point(point).powi(2)).sum::<f64>().sqrt()
    }

    /// What it says of its error; `unit` makes W/m2 of flux times weight.
    pub(crate) fn error(&self, weights: &[f64], unit: f64, stop: &Stop) -> FilmError {
        let measure = self.measure(weights, stop.measure);
        let weighted = |point: usize, values: &[f32]| {
            let weight = weights[point];
            [measure.relative(weight * f64::from(values[0]), weight * self.flux(point))]
        };
        let variances = weights
            .iter()
            .enumerate()
            .map(|(point, weight)| measure.relative(weight * self.flux_error(point), weight * self.flux(point)).powi(2));
        FilmError {
            bias: None,
            rounds: self.rounds,
            blocks: self.blocks,
            noise: self.relative_error(weights, stop.measure),
            freedom: self.latest.degrees_of_freedom(1, weights.len(), self.blocks, weighted, variances),
            unknown: self.unknown(weights, unit, stop),
            unseen: 0.0,
            places: None,
        }
    }

    /// Points of walls that reflect, but where no photon was stored: what is known of them is a bound. Of relative flux, a
    /// photon has 1 at most; `unit` makes W/m2 of flux times weight.
    pub(crate) fn unknown(&self, weights: &[f64], unit: f64, stop: &Stop) -> Unknown {
        let measure = self.measure(weights, stop.measure);
        let mut unknown = Unknown { asked: weights.iter().filter(|weight| **weight > 0.0).count() as u64, ..Unknown::default() };
        let mut bounds = 0.0;
        for (point, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            if self.is_unreached(point) {
                let most = weight * most_hits(stop.confidence);
                unknown.add_unreached(unit * most);
                bounds += measure.relative(most, 0.0).powi(2);
            }
        }
        unknown.with_relative(f64::sqrt(bounds))
    }

    /// [`RoomFilm::flux_error`], but infinite where few rounds give it, and where nothing was found on a wall that reflects.
    fn stated_error(&self, point: usize, albedo: f32) -> f64 {
        let is_unknown = self.blocks < LEAST_BLOCKS || albedo > 0.0 && self.is_unreached(point);
        if is_unknown { f64::INFINITY } else { self.flux_error(point) }
    }

    /// Whether no photon was found at a point.
    pub(crate) fn is_unreached(&self, point: usize) -> bool {
        self.units(point * self.channel_count as usize) == 0.0
    }

    pub(crate) fn point_count(&self) -> usize {
        self.sums.len() / self.channel_count as usize
    }

    /// A sum in fixed-point units.
    pub(crate) fn units(&self, sum: usize) -> f64 {
        let bits = self.sums[sum];
        let float = |word: u64| f64::from(f32::from_bits(word as u32));
        match self.kind {
            Sums::Integer => bits as f64,
            Sums::F32 => float(bits),
            Sums::Compensated => float(bits) + float(bits >> 32),
        }
    }

    /// Relative flux within the radius of a point.
    pub(crate) fn flux(&self, point: usize) -> f64 {
        self.units(point * self.channel_count as usize) / self.scale
    }

    /// The paper's photon power within the radius of a point.
    pub(crate) fn power(&self, point: usize) -> f64 {
        let last = self.channel_count as usize - 1;
        self.units(point * self.channel_count as usize + last) / self.scale
    }
}

/// One wall of the result: its texels row by row, column i along u, row j along v.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WallEstimate {
    pub name: &'static str,
    pub face: usize,
    /// Photon power over full light, not clamped: the paper shows 1 and more as full.
    pub illumination: Vec<f64>,
    /// Reflected flux an area, W/m2: what the stored photons, all of them reflected, estimate.
    pub radiosity: Vec<f64>,
    /// Arriving flux an area, W/m2: radiosity over albedo.
    pub irradiance: Vec<f64>,
    /// Their standard errors, W/m2; infinite where fewer than eight rounds are whole, and where no photon was found.
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
pub(crate) fn irradiance_weights(scene: &RoomScene, plan: &RoomPlan) -> Vec<f64> {
    let albedo = |point: usize| scene.faces[plan.points[point].wall as usize].as_ref().map_or(0.0, |wall| f64::from(wall.albedo));
    let weight = |(point, area): (usize, f64)| if albedo(point) > 0.0 { 1.0 / (area * albedo(point)) } else { 0.0 };
    areas(scene, plan).into_iter().enumerate().map(weight).collect()
}

/// Reads the film as the paper's illumination and in physical units.
///
/// The radiosity of a point is the flux of the photons stored within the radius over the area in
/// which they were looked for: with edge correction the part of the disc that lies on the wall,
/// without it the whole disc, which is dark along edges.
pub(crate) fn estimate_walls(film: &RoomFilm, scene: &RoomScene, plan: &RoomPlan) -> Vec<WallEstimate> {
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
