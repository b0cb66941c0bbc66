//! The film of all rounds: the mean of each pixel and its standard error, from integer sums.

use std::ops::Deref;

use glam::DVec3;

use crate::constants::{
    HIT_BRIGHT_PHOTON, HIT_CAUSTIC_PHOTON, HIT_GLOBAL_PHOTON, HIT_KINDS, HIT_SHADOW_RAY, HIT_UNSEEN_LIGHT, RADIUS_CLASSES,
};
use crate::engine::error_bound::FilmError;
use crate::engine::film::RoundSums;
use crate::engine::unknown::{Uncounted, Unknown, most_hits};
use crate::plan::buffers::ANOMALY_WORDS;
use crate::plan::radius::mean_squared_radius;
use crate::plan::scene::{MapPlan, ScenePlan};

/// Names of the kinds of `HIT_...`, but for those of light that no error counts.
const KINDS: [&str; 3] = ["shadow ray", "photon of the caustic map", "photon of the global map"];
/// In place of a bound: something has hit (`glsl/world/scene/one_hit.glsl`).
const REACHED: u32 = u32::MAX;
/// Of a pixel's light, what bright photons may add that is worth counting.
const WORTH_COUNTING: f64 = 0.1;

/// Exact sums over rounds, three channels a pixel, in film units, and what else a run leaves of its light.
#[derive(Debug, Clone)]
pub struct SceneFilm {
    pub of_rounds: RoundSums,
    /// For each pixel and kind of light what one hit would have added to a round, or that something has hit
    /// (`glsl/world/scene/one_hit.glsl`).
    pub one_hits: Vec<u32>,
    /// Light of each part (direct, specular, caustic, indirect) over all pixels and channels, film units.
    pub part_totals: Vec<u64>,
    /// Values that were no number, values clamped to the film's largest, estimates on a mesh too dense for the area within the
    /// radius to be found, camera paths that were cut off; then what was clamped and what was cut off, 64 bits each.
    pub anomalies: [u32; ANOMALY_WORDS],
    /// Visible points of each class of radii in the first round: of the global map, then of the caustic map.
    pub class_counts: Vec<u32>,
    /// Photons stored anywhere in the scene, by kind of light; 0 for shadow rays.
    pub stored: [u64; KINDS.len()],
}

/// Films are equal that hold the same light, whatever else was asked for and not found.
impl PartialEq for SceneFilm {
    fn eq(&self, other: &SceneFilm) -> bool {
        self.of_rounds == other.of_rounds
    }
}

impl Deref for SceneFilm {
    type Target = RoundSums;

    fn deref(&self) -> &RoundSums {
        &self.of_rounds
    }
}

impl SceneFilm {
    pub fn pixels(&self) -> usize {
        self.sums.len() / 3
    }

    /// Radiance (W/m2/sr) or irradiance (W/m2) of a pixel.
    pub fn mean(&self, pixel: usize, plan: &ScenePlan) -> DVec3 {
        let unit = plan.film_scale * f64::from(self.rounds.max(1));
        DVec3::from_array([0, 1, 2].map(|channel| self.sums[3 * pixel + channel] as f64 / unit))
    }

    /// The first and the last class that a point of this map has.
    pub fn classes(&self, map: &MapPlan) -> Option<(u32, u32)> {
        let first = if map.caustic_only { RADIUS_CLASSES as usize } else { 0 };
        let counts = self.class_counts.get(first..first + RADIUS_CLASSES as usize)?;
        let is_used = |count: &u32| *count > 0;
        Some((counts.iter().position(is_used)? as u32, counts.iter().rposition(is_used)? as u32))
    }

    /// Of every pixel.
    pub fn means(&self, plan: &ScenePlan) -> impl Iterator<Item = DVec3> {
        (0..self.pixels()).map(|pixel| self.mean(pixel, plan))
    }

    /// The same, channel by channel.
    pub fn values(&self, plan: &ScenePlan) -> Vec<f64> {
        self.means(plan).flat_map(|mean| mean.to_array()).collect()
    }

    /// Standard error of the mean, from the variance between rounds; of a single round nothing is known,
    /// and it is infinite. Where a channel lies below the film's unit few rounds may not show that it is rounded at random
    /// to 0 or 1: then the variance is at least what that rounding has.
    pub fn standard_error(&self, pixel: usize, plan: &ScenePlan) -> DVec3 {
        let rounds = f64::from(self.rounds);
        let is_lit = self.sums[3 * pixel..][..3] != [0; 3];
        DVec3::from_array([0, 1, 2].map(|channel| {
            let place = 3 * pixel + channel;
            let sum = self.sums[place];
            // That of a fraction f is f (1 - f), at most f and at most 1/4; a sum of 0 may be of any fraction below 1 / rounds.
            let rounding = (sum as f64).max(1.0).min(0.25 * plan.roundings_per_round() * rounds);
            let variance = self.variance(place, sum).max(if is_lit { rounding } else { 0.0 });
            variance.sqrt() / rounds / plan.film_scale
        }))
    }

    /// Of all pixels and channels.
    pub fn root_mean_square(&self, plan: &ScenePlan) -> f64 {
        let squares: f64 = self.means(plan).map(DVec3::length_squared).sum();
        (squares / (3 * self.pixels()).max(1) as f64).sqrt()
    }

    fn kinds(&self, pixel: usize) -> &[u32] {
        &self.one_hits[HIT_KINDS as usize * pixel..][..KINDS.len()]
    }

    /// Whether a pixel asked for light and nothing has reached it: its spread of 0 is no error.
    pub fn is_unreached(&self, pixel: usize) -> bool {
        let kinds = self.kinds(pixel);
        self.sums[3 * pixel..][..3] == [0; 3] && kinds.iter().any(|kind| *kind != 0) && !kinds.contains(&REACHED)
    }

    /// The errors to be shown, by pixel: infinite where nothing has reached the pixel, and where a value may have been clamped. The
    /// spread over rounds says nothing of a kind of light that has arrived elsewhere, but not here: its upper bound is part of the
    /// error. Nor does it say much of few hits: the next one may have in any channel what those had in the brightest, so that much
    /// is part of the error too. The report names the kinds that have reached no pixel at all.
    pub fn stated_errors<'a>(&'a self, plan: &'a ScenePlan) -> impl Fn(usize) -> DVec3 + 'a {
        let mut scales = self.bound_scales(plan, plan.settings.stop.confidence);
        let is_nowhere = |kind: &usize| self.stored[*kind] == 0;
        self.absent().into_iter().filter(is_nowhere).for_each(|kind| scales[kind] = 0.0);
        move |pixel| {
            if self.is_unreached(pixel) || self.may_be_clamped(pixel, plan) {
                return DVec3::INFINITY;
            }
            let unknown: f64 = (0..KINDS.len()).map(|kind| self.most_light(pixel, kind, &scales).powi(2)).sum();
            let (mean, error) = (self.mean(pixel, plan), self.standard_error(pixel, plan));
            // Of n hits the relative variance of the mean is about 1 / n.
            let one_hit = (error * error / mean).to_array().into_iter().filter(|hit| hit.is_finite()).fold(0.0, f64::max);
            error.map(|error| (error * error + one_hit * one_hit + unknown).sqrt())
        }
    }

    /// Whether the run clamped values, and this pixel has as much light as one of them.
    fn may_be_clamped(&self, pixel: usize, plan: &ScenePlan) -> bool {
        let largest = plan.point_limit().min(plan.film_limit / f64::from(plan.samples()));
        self.anomalies[1] > 0 && self.sums[3 * pixel..][..3].iter().any(|sum| *sum as f64 >= largest)
    }

    pub fn stated_error(&self, pixel: usize, plan: &ScenePlan) -> DVec3 {
        self.stated_errors(plan)(pixel)
    }

    /// Kinds of light that some pixels ask for, and that have reached none.
    fn absent(&self) -> Vec<usize> {
        let is_absent = |kind: &usize| {
            let of_kind = || (0..self.pixels()).map(|pixel| self.kinds(pixel)[*kind]);
            of_kind().any(|bits| bits != 0) && of_kind().all(|bits| bits != REACHED)
        };
        (0..KINDS.len()).filter(is_absent).collect()
    }

    /// Factors, by kind of light, that make an upper bound of what one hit would add, where there was none: the most hits that may be
    /// expected, over the rounds and, for photons, the squares of their radii.
    fn bound_scales(&self, plan: &ScenePlan, confidence: f64) -> [f64; KINDS.len()] {
        // Rounds with larger discs would have had more hits.
        let shrunk = mean_squared_radius(plan.settings.alpha, self.rounds);
        let per_disc = |map: &Option<MapPlan>| map.as_ref().map_or(0.0, |map| 1.0 / (plan.widest_radius(map, 0).powi(2) * shrunk));
        let mut scales = [most_hits(confidence) / f64::from(self.rounds.max(1)); KINDS.len()];
        scales[HIT_CAUSTIC_PHOTON as usize] *= per_disc(&plan.caustic);
        scales[HIT_GLOBAL_PHOTON as usize] *= per_disc(&plan.global);
        scales
    }

    /// The most light of a kind at a pixel, as far as no hit tells; 0 where there was one.
    fn most_light(&self, pixel: usize, kind: usize, scales: &[f64]) -> f64 {
        match self.kinds(pixel)[kind] {
            REACHED => 0.0,
            bits => scales[kind] * f64::from(f32::from_bits(bits)),
        }
    }

    /// What one hit of a kind of light that no error counts would have added to each pixel that it has not hit.
    fn missed(&self, kind: u32) -> impl Iterator<Item = (usize, f64)> {
        let of_pixel = move |pixel: usize| (pixel, self.one_hits[HIT_KINDS as usize * pixel + kind as usize]);
        let is_missed = |(_, bits): &(usize, u32)| *bits != 0 && *bits != REACHED;
        (0..self.pixels()).map(of_pixel).filter(is_missed).map(|(pixel, bits)| (pixel, f64::from(f32::from_bits(bits))))
    }

    /// Lights that the trial has not seen from a pixel, and towards which surfaces have stopped every ray since.
    fn hidden(&self, plan: &ScenePlan, confidence: f64) -> Uncounted {
        let stopped = || self.missed(HIT_UNSEEN_LIGHT).map(|(_, hit)| hit);
        let most = most_hits(confidence) / f64::from(self.rounds.max(1)) * stopped().fold(0.0, f64::max);
        // All of them together have as few hits as one.
        Uncounted { points: stopped().count() as u64, upper_bound: most, of_mean: over(most, self.total(plan)) }
    }

    /// Pixels that only dim photons have met, where bright ones may add what is worth counting. Photons are shared: the same hit may be
    /// missing in all of them.
    fn dim(&self, plan: &ScenePlan, scales: &[f64; KINDS.len()]) -> Uncounted {
        let bound = |(pixel, hit): (usize, f64)| (pixel, scales[HIT_GLOBAL_PHOTON as usize] * hit);
        let is_worth_it = |(pixel, most): &(usize, f64)| *most > WORTH_COUNTING * self.mean(*pixel, plan).max_element();
        let bounds = || self.missed(HIT_BRIGHT_PHOTON).map(bound).filter(is_worth_it).map(|(_, most)| most);
        Uncounted {
            points: bounds().count() as u64,
            upper_bound: bounds().fold(0.0, f64::max),
            of_mean: over(bounds().sum(), self.total(plan)),
        }
    }

    /// Light of all pixels, each in its brightest channel.
    fn total(&self, plan: &ScenePlan) -> f64 {
        self.means(plan).map(DVec3::max_element).sum()
    }

    /// Pixels, and kinds of light, of which no hit is all that is known.
    pub fn unknown(&self, plan: &ScenePlan, confidence: f64) -> Unknown {
        let scales = self.bound_scales(plan, confidence);
        let bound = |pixel: usize, kind: usize| self.most_light(pixel, kind, &scales);
        let pixels = || 0..self.pixels();
        let absent = self.absent();
        let names = absent.iter().map(|kind| KINDS[*kind]).collect();
        let (hidden, dim) = (self.hidden(plan, confidence), self.dim(plan, &scales));
        let mut unknown = Unknown { absent: names, hidden, dim, ..Unknown::default() };
        let (mut bounds, mut result, mut shadow_rays) = (0.0, 0.0, 0.0);
        for pixel in pixels() {
            result += self.mean(pixel, plan).length_squared();
            unknown.asked += u64::from(self.kinds(pixel).iter().any(|bits| *bits != 0));
            if self.is_unreached(pixel) {
                // Hits of all kinds together are as few as those of one.
                let most = (0..KINDS.len()).map(|kind| bound(pixel, kind)).fold(0.0, f64::max);
                unknown.add_unreached(most);
                bounds += 3.0 * most * most;
                continue;
            }
            for kind in &absent {
                let most = bound(pixel, *kind);
                if *kind == HIT_SHADOW_RAY as usize {
                    shadow_rays = most.max(shadow_rays);
                } else {
                    bounds += 3.0 * most * most;
                }
            }
        }
        // Each pixel has shadow rays of its own, and those of all have missed: the worst is that one pixel alone might have
        // been hit. Photons are shared, so that all pixels may be in the dark for the same reason.
        bounds += 3.0 * shadow_rays * shadow_rays;
        unknown.relative_to(bounds, result)
    }

    /// The most that hits of the brightest lamp in mirrors and glass may add to one pixel, where no round had any, relative to the
    /// result.
    fn unseen(&self, plan: &ScenePlan, confidence: f64) -> f64 {
        let hit = plan.rare_radiance / (f64::from(plan.samples()) * f64::from(self.rounds.max(1)));
        if hit == 0.0 { 0.0 } else { most_hits(confidence) * hit / self.means(plan).map(DVec3::length_squared).sum::<f64>().sqrt() }
    }

    /// What it tells of its error.
    pub fn error(&self, plan: &ScenePlan, confidence: f64) -> FilmError {
        let (noise, unknown) = (self.relative_error(plan), self.unknown(plan, confidence));
        let freedom = self.degrees_of_freedom(3, self.pixels(), |_| 1.0);
        FilmError { rounds: self.rounds, noise, freedom, unknown, unseen: self.unseen(plan, confidence) }
    }

    /// Root mean square over pixels and channels of standard error and of the mean; of pixels that nothing has reached see
    /// [`SceneFilm::unknown`].
    pub fn relative_error(&self, plan: &ScenePlan) -> f64 {
        if self.rounds < 2 {
            return if self.sums.iter().all(|sum| *sum == 0) { 0.0 } else { f64::INFINITY };
        }
        let (mut errors, mut means) = (0.0, 0.0);
        for pixel in 0..self.pixels() {
            errors += self.standard_error(pixel, plan).length_squared();
            means += self.mean(pixel, plan).length_squared();
        }
        if means > 0.0 { (errors / means).sqrt() } else { 0.0 }
    }
}

/// Of a result, which may be black.
fn over(light: f64, result: f64) -> f64 {
    if light > 0.0 { light / result } else { 0.0 }
}
