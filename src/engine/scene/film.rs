//! The film of a scene: the mean of each pixel and its standard error, from integer sums over blocks of rounds.

use std::ops::Deref;

use glam::DVec3;

use crate::constants::{
    HIT_BRIGHT_PHOTON, HIT_CAUSTIC_PHOTON, HIT_GLOBAL_PHOTON, HIT_KINDS, HIT_OFF_SURFACE, HIT_SHADOW_RAY, HIT_UNSEEN_LIGHT, PART_COUNT,
    RADIUS_CLASSES,
};
use crate::engine::error::bias::Bias;
use crate::engine::error::bound::{ErrorPlaces, ErrorSource, FilmError};
use crate::engine::error::differences::Differences;
use crate::engine::error::measure::ErrorMeasure;
use crate::engine::error::unknown::{OffSurfaces, Uncounted, Unknown, most_hits};
use crate::engine::film::{BlockSums, LatestBlocks, TooLarge, add_all};
use crate::plan::buffers::{ANOMALY_WORDS, PART_VALUES};
use crate::plan::film::{BiasPlan, FilmPlan, LostOffSurfaces};
use crate::plan::latest_blocks::kept_place;
use crate::plan::radius::mean_squared_radius;
use crate::plan::scene::MapPlan;
use crate::settings::stop::LEAST_BLOCKS;

/// Names of the kinds of `HIT_...`, but for those of light that no error counts.
const KINDS: [&str; 3] = ["shadow ray", "photon of the caustic map", GLOBAL_PHOTON];
pub(super) const GLOBAL_PHOTON: &str = "photon of the global map";
/// In place of a bound: something has hit (`glsl/world/scene/single_hit.glsl`).
const REACHED: u32 = u32::MAX;
/// Of a pixel's light, what bright photons may add that is worth counting.
const WORTH_COUNTING: f64 = 0.1;
/// Of all pixels, those that are reported as the worst.
const WORST: f64 = 0.01;
/// Hits from which on one more, of another colour than all of these, is less and less likely.
const FEW_HITS: f64 = 16.0;

/// Exact sums over blocks, three channels a pixel, in film units, and what else a run leaves of its light.
#[derive(Debug, Clone)]
pub struct SceneFilm {
    pub(crate) plan: FilmPlan,
    pub of_blocks: BlockSums,
    /// Of light that surfaces scatter; `None` where nothing else is seen, as of points.
    pub of_surfaces: Option<BlockSums>,
    /// Parts of that light at some pixels.
    pub(crate) latest: LatestBlocks,
    /// What a smaller radius would change; empty where blocks do not give the bias.
    pub(crate) differences: Differences,
    /// For each pixel and kind of light what one hit would have added to a round, or that something has hit
    /// (`glsl/world/scene/single_hit.glsl`).
    pub single_hits: Vec<u32>,
    /// Light of each part (direct, specular, caustic, indirect) over all pixels and channels, film units.
    pub part_totals: Vec<u64>,
    /// Specular, caustic and indirect light of each pixel, three channels each, film units; direct light is the rest. `None` where
    /// they were not kept apart.
    pub parts: Option<Vec<u64>>,
    /// Values that were no number, values clamped to the film's largest, estimates on a mesh too dense for the area within the
    /// radius to be found, camera paths that were cut off; then, 64 bits each, what was clamped, what was cut off, and samples that
    /// met a surface.
    pub anomalies: [u32; ANOMALY_WORDS],
    /// Visible points of each class of radii in the first round: of the global map, then of the caustic map.
    pub class_counts: Vec<u32>,
    /// Photons stored anywhere in the scene, by kind of light; 0 for shadow rays.
    pub stored: [u64; KINDS.len()],
}

/// Films are equal that hold the same light, whatever else was asked for and not found.
impl PartialEq for SceneFilm {
    fn eq(&self, other: &SceneFilm) -> bool {
        (&self.of_blocks, &self.of_surfaces, &self.latest, &self.differences)
            == (&other.of_blocks, &other.of_surfaces, &other.latest, &other.differences)
    }
}

impl Deref for SceneFilm {
    type Target = BlockSums;

    fn deref(&self) -> &BlockSums {
        &self.of_blocks
    }
}

impl SceneFilm {
    /// Adds the blocks of another part of the same run.
    pub(crate) fn merge(&mut self, other: &SceneFilm) -> Result<(), TooLarge> {
        self.of_blocks.merge(&other.of_blocks)?;
        self.of_surfaces.iter_mut().zip(&other.of_surfaces).try_for_each(|(surfaces, others)| surfaces.merge(others))?;
        self.latest.merge(&other.latest);
        self.differences.merge(&other.differences);
        // The most that one hit would have added, and what has hit is more than any.
        self.single_hits.iter_mut().zip(&other.single_hits).for_each(|(most, other)| *most = (*most).max(*other));
        add_all(&mut self.part_totals, &other.part_totals, u64::checked_add)?;
        self.parts = match (self.parts.take(), &other.parts) {
            (Some(mut parts), Some(others)) => {
                add_all(&mut parts, others, u64::checked_add)?;
                Some(parts)
            }
            _ => None,
        };
        add_all(&mut self.stored, &other.stored, u64::checked_add)?;
        for word in 0..4 {
            self.anomalies[word] = self.anomalies[word].saturating_add(other.anomalies[word]);
        }
        for word in (4..ANOMALY_WORDS).step_by(2) {
            let sum = wide_count(&self.anomalies, word).checked_add(wide_count(&other.anomalies, word)).ok_or(TooLarge)?;
            (self.anomalies[word], self.anomalies[word + 1]) = (sum as u32, (sum >> 32) as u32);
        }
        Ok(())
    }

    pub fn pixels(&self) -> usize {
        self.sums.len() / 3
    }

    /// Radiance (W/m2/sr) or irradiance (W/m2) of a pixel.
    pub fn mean(&self, pixel: usize) -> DVec3 {
        self.mean_of(&self.of_blocks, pixel)
    }

    fn mean_of(&self, light: &BlockSums, pixel: usize) -> DVec3 {
        let unit = self.plan.scale * f64::from(self.rounds.max(1));
        DVec3::from_array([0, 1, 2].map(|channel| light.sums[3 * pixel + channel] as f64 / unit))
    }

    /// Radiance of a part of a pixel's light, by its number among all parts; `None` where parts were not kept apart. The sums of all
    /// parts are that of the pixel, to the bit.
    pub fn mean_of_part(&self, part: usize, pixel: usize) -> Option<DVec3> {
        let unit = self.plan.scale * f64::from(self.rounds.max(1));
        Some(DVec3::from_array(self.sum_of_part(part, pixel)?.map(|sum| sum as f64 / unit)))
    }

    /// The same in film units.
    pub fn sum_of_part(&self, part: usize, pixel: usize) -> Option<[u64; 3]> {
        const OTHERS: usize = PART_COUNT as usize - 1;
        let others: &[[u64; 3]] = self.parts.as_ref()?.as_chunks().0;
        let others = &others[OTHERS * pixel..][..OTHERS];
        Some(match part {
            // A file may hold anything.
            0 => {
                [0, 1, 2].map(|channel| others.iter().fold(self.sums[3 * pixel + channel], |rest, part| rest.saturating_sub(part[channel])))
            }
            part => others[part - 1],
        })
    }

    /// Light that errors refer to: what surfaces scatter, sums and squares.
    fn surfaces(&self) -> &BlockSums {
        self.of_surfaces.as_ref().unwrap_or(&self.of_blocks)
    }

    /// Radiance of what surfaces scatter.
    pub fn surface_mean(&self, pixel: usize) -> DVec3 {
        self.mean_of(self.surfaces(), pixel)
    }

    pub fn surface_means(&self) -> impl Iterator<Item = DVec3> {
        (0..self.pixels()).map(|pixel| self.surface_mean(pixel))
    }

    /// The first and the last class that a point of this map has.
    pub(crate) fn classes(&self, map: &MapPlan) -> Option<(u32, u32)> {
        let first = if map.caustic_only { RADIUS_CLASSES as usize } else { 0 };
        let counts = self.class_counts.get(first..first + RADIUS_CLASSES as usize)?;
        let is_used = |count: &u32| *count > 0;
        Some((counts.iter().position(is_used)? as u32, counts.iter().rposition(is_used)? as u32))
    }

    /// Of every pixel.
    pub fn means(&self) -> impl Iterator<Item = DVec3> {
        (0..self.pixels()).map(|pixel| self.mean(pixel))
    }

    /// The same, channel by channel.
    pub fn values(&self) -> Vec<f64> {
        self.means().flat_map(|mean| mean.to_array()).collect()
    }

    /// Standard error of the mean, from the variance between blocks; of a single block nothing is known,
    /// and it is infinite. Where a channel lies below the film's unit few blocks may not show that it is rounded at random
    /// to 0 or 1: then the variance is at least what that rounding has.
    pub fn standard_error(&self, pixel: usize) -> DVec3 {
        self.error_of(&self.of_blocks, pixel)
    }

    /// The same of what surfaces scatter.
    pub fn surface_error(&self, pixel: usize) -> DVec3 {
        self.error_of(self.surfaces(), pixel)
    }

    fn error_of(&self, light: &BlockSums, pixel: usize) -> DVec3 {
        let rounds = f64::from(self.rounds);
        let is_lit = light.sums[3 * pixel..][..3] != [0; 3];
        DVec3::from_array([0, 1, 2].map(|channel| {
            let place = 3 * pixel + channel;
            // That of a fraction f is f (1 - f), at most f and at most 1/4; a sum of 0 may be of any fraction below 1 / rounds.
            let rounding = (light.sums[place] as f64).max(1.0).min(0.25 * self.plan.roundings_per_round * rounds);
            let variance = light.variance(place).max(if is_lit { rounding } else { 0.0 });
            variance.sqrt() / rounds / self.plan.scale
        }))
    }

    /// Root mean square of all pixels and channels.
    pub fn root_mean_square(&self) -> f64 {
        let squares: f64 = self.means().map(DVec3::length_squared).sum();
        (squares / (3 * self.pixels()).max(1) as f64).sqrt()
    }

    /// Samples that met a surface, over those of a pixel: as many pixels as show surfaces, by their shares.
    pub fn pixels_of_surfaces(&self) -> f64 {
        if self.of_surfaces.is_none() {
            return self.pixels() as f64;
        }
        wide_count(&self.anomalies, 8) as f64 / (f64::from(self.plan.samples) * f64::from(self.rounds.max(1)))
    }

    /// Nodes of the hierarchy that rays of camera paths visited, and triangles that discs of estimates were cut to.
    pub fn visited(&self) -> [u64; 2] {
        [10, 12].map(|word| wide_count(&self.anomalies, word))
    }

    /// How errors of its values add up.
    pub(crate) fn measure(&self) -> ErrorMeasure {
        let sum = self.surface_means().map(DVec3::element_sum).sum();
        ErrorMeasure::new(self.plan.measure, 3.0 * self.pixels_of_surfaces(), sum)
    }

    fn kinds(&self, pixel: usize) -> &[u32] {
        &self.single_hits[HIT_KINDS as usize * pixel..][..KINDS.len()]
    }

    /// Whether a pixel asked for light and nothing has reached it: its spread of 0 is no error.
    pub fn is_unreached(&self, pixel: usize) -> bool {
        let kinds = self.kinds(pixel);
        self.sums[3 * pixel..][..3] == [0; 3] && kinds.iter().any(|kind| *kind != 0) && !kinds.contains(&REACHED)
    }

    /// The errors to be shown, by pixel: infinite where too few blocks give it, where nothing has reached the pixel, and where a
    /// value may have been clamped. Few hits say little of the others: the next one may have in any channel what those had in the
    /// brightest, so that much is part of the error, and less of it the more hits there were. What no ray or photon has met is not: see
    /// [`SceneFilm::unseen_bounds`].
    pub fn stated_errors(&self) -> impl Fn(usize) -> DVec3 {
        let is_known = self.blocks >= LEAST_BLOCKS;
        move |pixel| {
            if !is_known || self.is_unreached(pixel) || self.may_be_clamped(pixel) || self.lacks_photons(pixel) {
                return DVec3::INFINITY;
            }
            let (mean, error) = (self.mean(pixel), self.standard_error(pixel));
            // Of n hits the relative variance of the mean is about 1 / n.
            let single_hit = |mean: f64, error: f64| error * error / mean * (FEW_HITS * (error / mean).powi(2)).min(1.0);
            let hits = [0, 1, 2].map(|channel| single_hit(mean[channel], error[channel]));
            let single_hit = hits.into_iter().filter(|hit| hit.is_finite()).fold(0.0, f64::max);
            error.map(|error| error.hypot(single_hit))
        }
    }

    /// Ends of the interval that holds a pixel's light as a run of infinitely many rounds would find it, with the film's confidence,
    /// of what rays and photons have met.
    pub fn intervals(&self) -> impl Fn(usize) -> [DVec3; 2] {
        let (errors, source) = (self.stated_errors(), self.error_source());
        move |pixel| {
            let [mean, error] = [self.mean(pixel), errors(pixel)].map(|value| value.to_array());
            let ends = [0, 1, 2].map(|channel| source.interval(mean[channel], error[channel]));
            [0, 1].map(|end| DVec3::from_array(ends.map(|ends| ends[end])))
        }
    }

    /// From what its standard errors are.
    pub fn error_source(&self) -> ErrorSource {
        ErrorSource { degrees_of_freedom: self.error_freedom(), confidence: self.plan.confidence }
    }

    /// Upper bounds of the light, in any channel, of which no hit is all that is known, by pixel, with the film's confidence: of kinds
    /// of light that asked and did not arrive, of lamps towards which every ray was stopped, and of bright photons where only dim ones
    /// came. Often there is no such light.
    pub fn unseen_bounds(&self) -> impl Fn(usize) -> f64 {
        let scales = self.bound_scales(self.plan.confidence);
        let per_ray = scales[HIT_SHADOW_RAY as usize];
        let of_kind = [(HIT_UNSEEN_LIGHT, per_ray), (HIT_BRIGHT_PHOTON, scales[HIT_GLOBAL_PHOTON as usize])];
        // Hits of all kinds together are as few as those of one: if all that were expected missed, the brightest kind adds most.
        move |pixel| {
            let others = of_kind.map(|(kind, scale)| match self.single_hits[HIT_KINDS as usize * pixel + kind as usize] {
                REACHED => 0.0,
                bits => scale * f64::from(f32::from_bits(bits)),
            });
            (0..KINDS.len()).map(|kind| self.most_light(pixel, kind, &scales)).chain(others).fold(0.0, f64::max)
        }
    }

    /// Whether it is a point on no surface, in a scene some of whose light only photons bring.
    fn lacks_photons(&self, pixel: usize) -> bool {
        self.plan.lost_off_surfaces != LostOffSurfaces::Nothing
            && self.single_hits[HIT_KINDS as usize * pixel + HIT_OFF_SURFACE as usize] == REACHED
    }

    /// All of these.
    fn off_surfaces(&self) -> OffSurfaces {
        let numbers = || (0..self.pixels()).filter(|pixel| self.lacks_photons(*pixel)).map(|pixel| pixel as u64 + 1);
        let lost = match self.plan.lost_off_surfaces {
            LostOffSurfaces::Nothing => "",
            LostOffSurfaces::Caustics => "light that point, spot, directional and disc lights send over mirrors and glass",
            LostOffSurfaces::Lamps => "all light of lamps but the direct light of emissive meshes (`illumination` photons)",
        };
        OffSurfaces {
            points: numbers().count() as u64,
            of: self.pixels() as u64,
            first: numbers().take(OffSurfaces::NAMED).collect(),
            lost,
        }
    }

    /// Whether the run clamped values, and this pixel has as much light as one of them.
    fn may_be_clamped(&self, pixel: usize) -> bool {
        let largest = self.plan.point_limit.min(self.plan.limit / f64::from(self.plan.samples));
        self.anomalies[1] > 0 && self.sums[3 * pixel..][..3].iter().any(|sum| *sum as f64 >= largest)
    }

    pub fn stated_error(&self, pixel: usize) -> DVec3 {
        self.stated_errors()(pixel)
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
    fn bound_scales(&self, confidence: f64) -> [f64; KINDS.len()] {
        // Rounds with larger discs would have had more hits.
        let shrunk = mean_squared_radius(self.plan.alpha, self.rounds);
        let [of_global, of_caustic] =
            self.plan.widest_radii.map(|radius| if radius > 0.0 { 1.0 / (radius * radius * shrunk) } else { 0.0 });
        let mut scales = [most_hits(confidence) / f64::from(self.rounds.max(1)); KINDS.len()];
        scales[HIT_CAUSTIC_PHOTON as usize] *= of_caustic;
        scales[HIT_GLOBAL_PHOTON as usize] *= of_global;
        scales
    }

    /// The most light of a kind at a pixel, as far as no hit says; 0 where there was one.
    fn most_light(&self, pixel: usize, kind: usize, scales: &[f64]) -> f64 {
        match self.kinds(pixel)[kind] {
            REACHED => 0.0,
            bits => scales[kind] * f64::from(f32::from_bits(bits)),
        }
    }

    /// What one hit of a kind of light that no error counts would have added to each pixel that it has not hit.
    fn missed(&self, kind: u32) -> impl Iterator<Item = (usize, f64)> {
        let of_pixel = move |pixel: usize| (pixel, self.single_hits[HIT_KINDS as usize * pixel + kind as usize]);
        let is_missed = |(_, bits): &(usize, u32)| *bits != 0 && *bits != REACHED;
        (0..self.pixels()).map(of_pixel).filter(is_missed).map(|(pixel, bits)| (pixel, f64::from(f32::from_bits(bits))))
    }

    /// Lights that the trial has not seen from a pixel, and towards which surfaces have stopped every ray since.
    fn hidden(&self, confidence: f64) -> Uncounted {
        let stopped = || self.missed(HIT_UNSEEN_LIGHT).map(|(_, hit)| hit);
        let most = most_hits(confidence) / f64::from(self.rounds.max(1)) * stopped().fold(0.0, f64::max);
        // All of them together have as few hits as one.
        Uncounted { points: stopped().count() as u64, upper_bound: most, of_mean: over(most, self.total()) }
    }

    /// Pixels that only dim photons have met, where bright ones may add what is worth counting. Photons are shared: the same hit may be
    /// missing in all of them.
    fn dim(&self, scales: &[f64; KINDS.len()]) -> Uncounted {
        let bound = |(pixel, hit): (usize, f64)| (pixel, scales[HIT_GLOBAL_PHOTON as usize] * hit);
        let is_worth_it = |(pixel, most): &(usize, f64)| *most > WORTH_COUNTING * self.mean(*pixel).max_element();
        let bounds = || self.missed(HIT_BRIGHT_PHOTON).map(bound).filter(is_worth_it).map(|(_, most)| most);
        Uncounted {
            points: bounds().count() as u64,
            upper_bound: bounds().fold(0.0, f64::max),
            of_mean: over(bounds().sum(), self.total()),
        }
    }

    /// Pixels that some light has reached, and a kind of light that arrived at others has not.
    fn unseen_kinds(&self, scales: &[f64; KINDS.len()], absent: &[usize]) -> Uncounted {
        let mut unseen = Uncounted::default();
        let (mut of_photons, mut of_rays) = (0.0, 0.0f64);
        for pixel in (0..self.pixels()).filter(|pixel| !self.is_unreached(*pixel)) {
            let bounds = [HIT_SHADOW_RAY, HIT_CAUSTIC_PHOTON, HIT_GLOBAL_PHOTON].map(|kind| match absent.contains(&(kind as usize)) {
                true => 0.0,
                false => self.most_light(pixel, kind as usize, scales),
            });
            let most = bounds.into_iter().fold(0.0, f64::max);
            unseen.points += u64::from(most > 0.0);
            unseen.upper_bound = unseen.upper_bound.max(most);
            of_photons += bounds[1].max(bounds[2]);
            of_rays = of_rays.max(bounds[0]);
        }
        // Photons are shared, and shadow rays are each pixel's own, as in what is unknown.
        Uncounted { of_mean: over(of_photons + of_rays, self.total()), ..unseen }
    }

    /// Light of surfaces in all pixels, each in its brightest channel.
    fn total(&self) -> f64 {
        self.surface_means().map(DVec3::max_element).sum()
    }

    /// Pixels, and kinds of light, of which no hit is all that is known.
    pub(crate) fn unknown(&self, confidence: f64) -> Unknown {
        let scales = self.bound_scales(confidence);
        let bound = |pixel: usize, kind: usize| self.most_light(pixel, kind, &scales);
        let pixels = || 0..self.pixels();
        let absent = self.absent();
        let names = absent.iter().map(|kind| KINDS[*kind]).collect();
        let (hidden, dim, unseen) = (self.hidden(confidence), self.dim(&scales), self.unseen_kinds(&scales, &absent));
        let off_surfaces = self.off_surfaces();
        let mut unknown = Unknown { absent: names, hidden, dim, unseen, off_surfaces, ..Unknown::default() };
        let measure = self.measure();
        let square = |most: f64, pixel: usize| {
            let values = self.surface_mean(pixel).to_array();
            values.into_iter().map(|value| measure.relative(most, value).powi(2)).sum::<f64>()
        };
        let (mut bounds, mut shadow_rays) = (0.0, 0.0f64);
        for pixel in pixels() {
            unknown.asked += u64::from(self.kinds(pixel).iter().any(|bits| *bits != 0));
            if self.is_unreached(pixel) {
                // Hits of all kinds together are as few as those of one.
                let most = (0..KINDS.len()).map(|kind| bound(pixel, kind)).fold(0.0, f64::max);
                unknown.add_unreached(most);
                bounds += square(most, pixel);
                continue;
            }
            for kind in &absent {
                let most = bound(pixel, *kind);
                if *kind == HIT_SHADOW_RAY as usize {
                    shadow_rays = square(most, pixel).max(shadow_rays);
                } else {
                    bounds += square(most, pixel);
                }
            }
        }
        // Each pixel has shadow rays of its own, and those of all have missed: the worst is that one pixel alone might have
        // been hit. Photons are shared, so that all pixels may be in the dark for the same reason.
        bounds += shadow_rays;
        let relative = if unknown.off_surfaces.is_all() { f64::INFINITY } else { bounds.sqrt() };
        unknown.with_relative(relative)
    }

    /// The most that hits of the brightest lamp in mirrors and glass may add to one pixel, where no round had any, relative to the
    /// result.
    fn unseen(&self, confidence: f64) -> f64 {
        let hit = self.plan.rare_radiance / (f64::from(self.plan.samples) * f64::from(self.rounds.max(1)));
        self.measure().relative_to_mean(most_hits(confidence) * hit)
    }

    /// What it says of its error, that of what surfaces scatter.
    pub fn error(&self, confidence: f64) -> FilmError {
        let measure = self.measure();
        let value = |place: usize, parts: &[f32]| {
            let mean = self.surface_mean(place);
            let of_channel = |channel: usize| {
                let sum: f64 = parts.iter().skip(channel).step_by(3).map(|part| f64::from(*part)).sum();
                // As an error counts that goes with it.
                sum * measure.relative(1.0, mean[channel])
            };
            [0, 1, 2].map(of_channel)
        };
        let variances = (0..self.pixels()).map(|pixel| {
            let (error, mean) = (self.surface_error(pixel), self.surface_mean(pixel));
            [0, 1, 2].map(|channel| measure.relative(error[channel], mean[channel]).powi(2)).iter().sum()
        });
        FilmError {
            rounds: self.rounds,
            blocks: self.blocks,
            noise: self.relative_error(),
            freedom: self.latest.degrees_of_freedom(PART_VALUES as usize, self.pixels(), self.blocks, value, variances),
            unknown: self.unknown(confidence),
            unseen: self.unseen(confidence),
            bias: self.bias(confidence, &measure),
            places: self.error_places(&measure),
        }
    }

    /// The bias of the radii; `None` where only extra runs can give it, or there is no whole block.
    fn bias(&self, confidence: f64, measure: &ErrorMeasure) -> Option<Bias> {
        match self.plan.bias {
            BiasPlan::NoMap => Some(Bias::none(confidence)),
            BiasPlan::Nothing => Some(Bias::unknown(confidence)),
            BiasPlan::Blocks if self.blocks > 0 => {
                let relative = measure.relative_to_mean(1.0 / (self.plan.scale * f64::from(self.plan.rounds_per_block)));
                Some(self.differences.bias(self.pixels(), relative, confidence))
            }
            BiasPlan::Blocks | BiasPlan::ExtraRuns => None,
        }
    }

    /// The relative error of the noise, as the film's measure adds it up; of pixels that nothing has reached see
    /// [`SceneFilm::unknown`].
    pub fn relative_error(&self) -> f64 {
        if self.blocks < 2 {
            return if self.surfaces().sums.iter().all(|sum| *sum == 0) { 0.0 } else { f64::INFINITY };
        }
        self.squared_errors(&self.measure()).sum::<f64>().sqrt()
    }

    /// What each pixel adds to the square of the relative error.
    fn squared_errors(&self, measure: &ErrorMeasure) -> impl Iterator<Item = f64> {
        (0..self.pixels()).map(move |pixel| {
            let (error, mean) = (self.surface_error(pixel), self.surface_mean(pixel));
            [0, 1, 2].map(|channel| measure.relative(error[channel], mean[channel]).powi(2)).into_iter().sum()
        })
    }

    /// Where the error of the noise sits; `None` where it is not known.
    fn error_places(&self, measure: &ErrorMeasure) -> Option<ErrorPlaces> {
        let mut squares: Vec<f64> = if self.blocks < 2 { Vec::new() } else { self.squared_errors(measure).collect() };
        let sum: f64 = squares.iter().sum();
        if sum == 0.0 || !sum.is_finite() {
            return None;
        }
        let worst = ((WORST * squares.len() as f64).ceil() as usize).clamp(1, squares.len());
        squares.sort_unstable_by(|a, b| b.total_cmp(a));
        Some(ErrorPlaces {
            worst_pixels: worst as u64,
            of_worst_pixels: squares[..worst].iter().sum::<f64>() / sum,
            of_parts: self.error_of_parts(measure)?,
        })
    }

    /// The share of each part of light in the squared error, from the spread of the latest blocks at some pixels; parts are taken for
    /// independent. `None` where these pixels had no spread.
    fn error_of_parts(&self, measure: &ErrorMeasure) -> Option<[f64; PART_COUNT as usize]> {
        let mut variances = [0.0; PART_COUNT as usize];
        let mut sums = vec![[0.0f64; 2]; self.latest.iter().next()?.values.len()];
        for block in self.latest.iter() {
            for ([sum, squares], value) in sums.iter_mut().zip(&block.values) {
                *sum += f64::from(*value);
                *squares += f64::from(*value).powi(2);
            }
        }
        let count = self.latest.iter().count() as f64;
        for (place, sums) in sums.chunks_exact(PART_VALUES as usize).enumerate() {
            let Some(pixel) = kept_place(place, self.pixels()) else { continue };
            let mean = self.surface_mean(pixel);
            for (k, [sum, squares]) in sums.iter().enumerate() {
                let variance = (squares - sum * sum / count).max(0.0);
                variances[k / 3] += measure.relative(variance.sqrt(), mean[k % 3]).powi(2);
            }
        }
        let all: f64 = variances.iter().sum();
        (all > 0.0 && all.is_finite()).then(|| variances.map(|variance| variance / all))
    }
}

/// A count of two words.
fn wide_count(words: &[u32], word: usize) -> u64 {
    u64::from(words[word]) | u64::from(words[word + 1]) << 32
}

/// Of a result, which may be black.
fn over(light: f64, result: f64) -> f64 {
    if light > 0.0 { light / result } else { 0.0 }
}
