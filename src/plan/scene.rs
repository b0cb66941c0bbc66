//! The plan of a scene, as [`super::planning`] makes it: effects, maps, the radius of each round, and the sizes of dispatches.

use std::time::Duration;

use serde::Serialize;

use super::capacity::{Limits, Persistence};
use super::evidence::EffectDecision;
use super::extra_samples::ExtraSamples;
use super::film::FilmPlan;
use super::light_choice::LightChoice;
use super::radius::{self, Classes, RADIUS_RANGE, RadiusFrom, Trial};
use super::sensor::Sensor;
use crate::constants::*;
use crate::records::*;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::{Effect, Part, SceneSettings};

/// What a plan is made of.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) scene: &'a Scene,
    pub(super) geometry: &'a Geometry,
    pub(super) settings: &'a SceneSettings,
    pub(super) sensor: Sensor,
    pub(super) limits: &'a Limits,
    pub(super) trial: Option<&'a Trial>,
}

/// A photon map of each round.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct MapPlan {
    pub name: &'static str,
    pub domain: u32,
    /// Photons of a round.
    pub photons: u32,
    /// Photons traced at once, and entries that the map of those can have.
    pub chunk_photons: u32,
    pub capacity: u32,
    /// Paths that one flight hands to the next: none where each photon has an invocation to its end.
    pub path_array_length: u32,
    /// How photons are dealt to invocations that keep them to their end.
    pub persistence: Persistence,
    /// Bounces after which photons are cut off.
    pub bounces: u32,
    /// Bounces that photons take before the host looks how many are left: all, where few enough land in the map for certain and
    /// the device runs loops so long.
    pub segment_bounces: u32,
    /// Mask of the arrivals that are stored.
    pub stored: u32,
    /// Photons end where they scatter.
    pub caustic_only: bool,
    /// And so each lands once at most: no surface that keeps photons lets light pass.
    pub lands_once: bool,
    pub bucket_count: u32,
    /// Of the first round, normalised; where it differs from point to point, that of the median one.
    pub radius: f64,
    pub radius_from: RadiusFrom,
    /// `None` where all points have the same radius.
    pub classes: Option<Classes>,
    /// Photons of a round that lie within it, on average.
    pub expected: f64,
    /// The same at the median point, as a trial is to find it.
    pub neighbours: f64,
    /// Invocations that share the candidates of a visible point.
    pub lanes: u32,
    /// Spheres that its photons are aimed at; 0: lights emit them in all directions.
    pub target_count: u32,
    /// Those from beyond the scene are aimed at its openings.
    pub through_openings: bool,
    /// A power of two by which its photons carry more than they stand for: aimed ones stand for a share of their
    /// light's, and their sums have a fixed point.
    pub flux_gain: f64,
    /// By how much more a photon of relative flux 1 carries than where lights are chosen by power.
    pub flux_scale: f64,
}

impl MapPlan {
    /// Candidates of a point among the photons of a chunk, roughly.
    pub(crate) fn tests_per_point(&self) -> u64 {
        let of_chunk = self.expected * f64::from(self.chunk_photons) / f64::from(self.photons.max(1));
        TESTS_PER_POINT.max((TESTS_PER_PHOTON * of_chunk) as u64)
    }

    /// Words of the counters: length of the map, then of the lists of a segment.
    pub(crate) fn counter_count(&self) -> u64 {
        2 + u64::from(self.segment_bounces.min(SEGMENT_BOUNCES))
    }

    /// W of a photon of relative flux 1, over the square of the scene's unit.
    pub(crate) fn photon_flux(&self, geometry: &Geometry) -> f64 {
        self.photon_flux_of(geometry, self.photons)
    }

    /// The same in a round of so many photons.
    pub(crate) fn photon_flux_of(&self, geometry: &Geometry, photons: u32) -> f64 {
        geometry.flux_unit * self.flux_scale / (f64::from(photons.max(1)) * self.flux_gain)
    }

    /// (first photon, count) of each chunk.
    pub(crate) fn chunks(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let (photons, step) = (self.photons, self.chunk_photons);
        (0..photons.div_ceil(step)).map(move |chunk| (chunk * step, step.min(photons - chunk * step)))
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct ScenePlan {
    pub settings: SceneSettings,
    pub(crate) sensor: Sensor,
    /// What found the radii that nobody has given; `None` where nothing was tried.
    pub(crate) trial: Option<Trial>,
    pub(crate) decisions: Vec<EffectDecision>,
    /// Specialization constants of all kernels.
    pub constants: Vec<(&'static str, u32)>,
    pub(crate) global: Option<MapPlan>,
    pub(crate) caustic: Option<MapPlan>,
    /// Mask of `SURFACE_...` whose caustics are wanted.
    pub caustic_surfaces: u32,
    /// What photons of the caustic map are aimed at.
    pub(crate) targets: Vec<CausticTarget>,
    /// Visible points that one camera path may have.
    pub points_per_path: u32,
    /// Those of tiles with more samples than all pixels have.
    pub(crate) extra_samples: ExtraSamples,
    /// Sets of sums a visible point has, one an arrival.
    pub arrival_sets: u32,
    /// Mask of the arrivals that some map holds.
    pub arrivals: u32,
    /// Surfaces that one dispatch follows a camera path over.
    pub chain_steps: u32,
    pub(crate) film: FilmPlan,
    /// The light that counts: of a pilot that looks at one kind alone.
    pub(crate) light_of: LightOf,
    /// Width of a pixel's filter over the distance between pixels, which are spread where it is less than 1.
    pub footprint: f64,
    /// Rays or pair tests after which commands are handed to the device.
    pub work_per_submission: u64,
    /// Bytes of all buffers, with one set of receivers; see [`ScenePlan::bytes_of`].
    pub bytes: u64,
    /// Time that planning took.
    pub planned_in: Duration,
}

/// Light of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LightOf {
    All,
    /// That paths find, and that of one of the two maps.
    Paths,
    GlobalMap,
    CausticMap,
}

impl LightOf {
    pub(crate) fn has_paths(self) -> bool {
        matches!(self, LightOf::All | LightOf::Paths)
    }

    pub(crate) fn has_map(self, caustic_only: bool) -> bool {
        self == LightOf::All || self == if caustic_only { LightOf::CausticMap } else { LightOf::GlobalMap }
    }
}

/// Candidates of a point, roughly: what a lookup counts as work.
pub(crate) const TESTS_PER_POINT: u64 = 256;
/// Photons in the cells in reach for each within the radius.
const TESTS_PER_PHOTON: f64 = 4.0;
/// Landings of each photon of a chunk that a map has room for.
pub(crate) const SEGMENT_BOUNCES: u32 = 16;
/// Flights of a photon, generously.
const FLIGHTS_PER_PHOTON: u64 = 8;
/// Work of a ray, in pair tests.
const RAY_COST: u64 = 64;

/// Share of the points that may lie in something smaller than the radius.
const TOO_WIDE: f64 = 0.1;

impl ScenePlan {
    pub fn simulates(&self, effect: Effect) -> bool {
        self.decisions.iter().any(|decision| decision.effect == effect && decision.kept)
    }

    /// Whether the parts of each pixel's light are kept apart.
    pub fn keeps_parts(&self) -> bool {
        self.settings.keeps_parts && matches!(self.sensor, Sensor::Picture { .. }) && self.settings.part == Part::All
    }

    /// Whether many points of the trial lie in something narrower than the radius.
    pub fn radius_is_too_wide(&self) -> bool {
        self.trial.as_ref().is_some_and(|trial| trial.too_wide > TOO_WIDE)
    }

    /// Whether that radius also leaves no room for a smaller one, as the scene is so much wider than what the points lie in.
    pub fn bias_is_unknown(&self) -> bool {
        let is_least = |map: &MapPlan| map.radius_from == RadiusFrom::Trial && map.radius < crate::settings::ROOM_BELOW * RADIUS_RANGE.0;
        self.radius_is_too_wide() && self.maps().any(is_least)
    }

    /// What traces the photons: the settings' builder, or the one that was chosen.
    pub fn builder(&self) -> Builder {
        self.settings.builder.expect("the plan chose a builder")
    }

    /// Of the light that counts.
    pub(crate) fn traced_maps(&self) -> impl Iterator<Item = &MapPlan> {
        self.maps().filter(|map| self.light_of.has_map(map.caustic_only))
    }

    pub(crate) fn maps(&self) -> impl Iterator<Item = &MapPlan> {
        self.global.iter().chain(&self.caustic)
    }

    /// The same by a builder that stops after each flight and leaves no gaps; `bytes` stay those of the run.
    pub fn by_flights(&self) -> ScenePlan {
        let mut plan = self.clone();
        let was_persistent = plan.builder() == Builder::Persistent;
        plan.settings.builder = Some(Builder::Ballot);
        if was_persistent {
            for map in plan.global.iter_mut().chain(&mut plan.caustic) {
                map.path_array_length = map.chunk_photons;
                map.segment_bounces = map.bounces.min(SEGMENT_BOUNCES);
            }
        }
        plan
    }

    /// Whether radii differ from point to point.
    pub fn has_classes(&self) -> bool {
        self.maps().any(|map| map.classes.is_some())
    }

    /// Whether density estimates end at walls.
    pub fn cuts_discs(&self) -> bool {
        self.settings.edge_correction && self.maps().next().is_some()
    }

    /// Where the cuts of a map's discs begin among those of all.
    pub fn first_cut(&self, caustic_only: bool) -> u32 {
        if caustic_only && self.global.is_some() { self.visible_points() } else { 0 }
    }

    /// Openings that a trial found, and as many of radius 0 as there may be more; none where no light comes from beyond the scene.
    pub(crate) fn openings(&self) -> Vec<CausticTarget> {
        let mut openings = self.trial.as_ref().map_or_else(Vec::new, |trial| trial.openings.clone());
        openings.resize(if self.constant("HAS_OPENINGS") != 0 { MAX_OPENINGS as usize } else { 0 }, CausticTarget::default());
        openings
    }

    /// How shadow rays choose lights; `None` where they do by power.
    pub(crate) fn lights(&self) -> Option<&LightChoice> {
        self.trial.as_ref()?.lights.as_deref().filter(|_| self.constant("HAS_LIGHT_CLUSTERS") != 0)
    }

    /// Radius of class 0 in a round, normalised; of all points where there are no classes.
    pub(crate) fn widest_radius(&self, map: &MapPlan, round: u32) -> f64 {
        radius::of_round(map.radius * map.classes.map_or(1.0, Classes::widest), self.settings.alpha, round)
    }

    /// Radius of a map in a round, normalised: r_(i+1)^2 = r_i^2 (i + alpha) / (i + 1) with i from 1
    /// (Knaus and Zwicker 2011, equation 15).
    pub(crate) fn radius(&self, map: &MapPlan, round: u32) -> f64 {
        radius::of_round(map.radius, self.settings.alpha, round)
    }

    /// Bounces whose fates are counted apart.
    pub fn tally_rows(&self) -> u32 {
        self.settings.bounces.min(TALLY_ROWS)
    }

    pub fn visible_points(&self) -> u32 {
        self.paths().saturating_mul(self.points_per_path)
    }

    /// Items of one dispatch that casts `rays` rays each.
    pub fn items_at_once(&self, rays: u32) -> u32 {
        (self.work_per_submission / (RAY_COST * u64::from(rays.max(1)))).clamp(1 << 12, 1 << 22) as u32
    }

    /// Photons that one dispatch traces from their light to their end, in a fraction of a second.
    pub fn photons_per_dispatch(&self) -> u32 {
        (self.work_per_submission / (RAY_COST * FLIGHTS_PER_PHOTON)).clamp(1, u64::from(u32::MAX)) as u32
    }

    /// Visible points of one lookup, which has a work group of them along x.
    pub fn points_at_once(&self) -> u32 {
        let lanes = self.maps().map(|map| map.lanes).max().unwrap_or(1);
        let most = (self.work_per_submission / TESTS_PER_POINT).clamp(1 << 12, 1 << 22) as u32;
        most.min(self.visible_points()).min(MAX_GROUPS * self.settings.group_size / lanes)
    }

    /// Whether a camera path may be under way when its dispatch ends.
    pub fn chains_go_on(&self) -> bool {
        self.chain_steps < MAX_BOUNCES && (self.constant("HAS_SPECULAR_CHAINS") | self.constant("HAS_PASSING")) != 0
    }

    /// Camera paths that one dispatch may leave.
    pub fn camera_path_capacity(&self) -> u64 {
        if self.chains_go_on() { u64::from(self.camera_paths_at_once()) } else { 0 }
    }

    /// Camera paths of one dispatch, at most.
    pub fn camera_paths_at_once(&self) -> u32 {
        self.items_at_once(self.rays_per_path()).min(self.paths())
    }

    /// Rays of a camera path, roughly.
    pub fn rays_per_path(&self) -> u32 {
        self.points_per_path * (1 + self.shadow_rays())
    }

    /// Paths from the camera through each pixel, or from a receiver, in a round.
    pub fn samples(&self) -> u32 {
        if matches!(self.sensor, Sensor::Picture { .. }) { self.settings.samples } else { 1 }
    }

    /// Paths of a round, with those that some tiles have beyond these.
    pub fn paths(&self) -> u32 {
        self.sensor.pixels().saturating_mul(self.samples()).saturating_add(self.extra_samples.count)
    }

    /// Rays towards lights from a visible point; none where the maps hold direct light too.
    pub fn shadow_rays(&self) -> u32 {
        self.constant("HAS_SHADOW_RAYS") * self.settings.shadow_rays
    }

    /// The same as the kernels take it.
    pub(crate) fn work(&self) -> WorkDivision {
        WorkDivision {
            samples: self.samples(),
            shadow_rays: self.shadow_rays(),
            rounds_per_block: self.film.rounds_per_block,
            extra_samples: self.extra_samples.count,
        }
    }

    pub fn constant(&self, name: &str) -> u32 {
        self.constants.iter().find(|(known, _)| *known == name).map_or(0, |(_, value)| *value)
    }

    /// Effects that the scene needs and the user left out.
    pub fn missing(&self) -> Vec<Effect> {
        self.decisions.iter().filter(|decision| decision.needed && !decision.kept).map(|decision| decision.effect).collect()
    }
}
