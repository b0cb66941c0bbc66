//! What is asked of a scene: one field for each option ([`super::options`]). What is not given is as usual, or a pilot's to choose.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::values::{Layers, Percent, Seconds, Shininess, Stops, SunPosition, Threads, Variant, Watts};
use crate::engine::run::blocks;
use crate::output::colour::Tone;
use crate::output::white_balance::Kelvin;
use crate::plan::work_division::TunableSettings;
use crate::rng::Rng;
use crate::scene::Reading;
use crate::scene::image_size::ImageSize;
use crate::scene::surroundings::{Environment, Surroundings};
use crate::settings::scene::{Effect, Filter, Illumination, Kernel, MAX_ROUNDS, Part, SceneSettings, Stop};
use crate::settings::stop::Measure;
use crate::settings::{EmissionLaw, Gather, Math, PhongDirection, Preset, Sums};

/// `None`: as usual. Some fields are of scenes, some of the paper's box, and most of both. Each field is the option of the same name, with `-` for `_`, and means what `photonmill render --help` says of it; so
/// do Python's keyword arguments.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderRequest {
    /// A glTF file, or the name of a built-in scene.
    pub scene: String,

    pub exposure: Option<Stops>,
    pub tone: Option<Tone>,
    pub white_balance: Option<Kelvin>,
    pub layers: Option<Layers>,
    pub denoise: bool,

    pub radiometric: bool,
    pub at: Option<f64>,
    pub environment: Option<Environment>,
    pub sun: Option<SunPosition>,
    pub environment_rotate: Option<f64>,
    pub environment_strength: Option<f32>,

    pub camera: Option<String>,
    pub eye: Option<DVec3>,
    pub look_at: Option<DVec3>,
    pub up: Option<DVec3>,
    pub fov: Option<f64>,
    pub orthographic: Option<f64>,
    pub size: Option<ImageSize>,
    pub aperture: Option<f64>,
    pub focus: Option<f64>,
    pub emission: Option<EmissionLaw>,
    pub shininess: Option<Shininess>,
    pub phong_direction: Option<PhongDirection>,
    pub reflectance: Option<f32>,
    pub light_radius: Option<f64>,
    pub light_power: Option<Watts>,

    pub error: Option<Percent>,
    pub measure: Option<Measure>,
    pub confidence: Option<Percent>,
    pub time: Option<Seconds>,
    pub total_photons: Option<u64>,
    pub bias: bool,
    pub checkpoint: Option<PathBuf>,
    pub every: Option<Seconds>,
    pub resume: Option<PathBuf>,
    pub shard: Option<blocks::Share>,

    pub preset: Option<Preset>,
    pub photons: Option<u32>,
    pub caustic_photons: Option<u32>,
    pub bounces: Option<u32>,
    pub aim: Option<bool>,
    pub map: Option<PathBuf>,
    pub rounds: Option<u32>,
    pub block: Option<u32>,
    pub rng: Option<Rng>,
    pub seed: Option<u64>,

    pub illumination: Option<Illumination>,
    pub settings: Option<PathBuf>,
    pub with: Vec<Effect>,
    pub without: Vec<Effect>,
    pub shadow_rays: Option<u32>,
    pub final_gather: bool,
    pub part: Option<Part>,
    pub samples: Option<u32>,
    pub save_settings: Option<PathBuf>,
    pub filter: Option<Filter>,

    pub neighbours: Option<u32>,
    pub caustic_neighbours: Option<u32>,
    pub radius: Option<f64>,
    pub caustic_radius: Option<f64>,
    pub alpha: Option<f64>,
    pub fixed_radius: bool,
    pub kernel: Option<Kernel>,
    pub edge_correction: Option<bool>,
    pub full_light: Option<f64>,
    pub nearest: Option<u32>,
    pub mesh: Option<u32>,

    pub variant: Option<Variant>,
    pub gather: Option<Gather>,
    pub sums: Option<Sums>,
    pub counters: Option<u32>,
    pub threads: Option<Threads>,
    pub math: Option<Math>,
    pub chunk: Option<u32>,
    pub group_size: Option<u32>,
    pub paranoid: bool,
}

/// Most rounds of a run that ends at a goal other than a number of photons.
const MOST_ROUNDS: u32 = 65_536;
/// When a picture is good enough to be shown, where nothing says when it ends.
const GOOD_ERROR: f64 = 0.02;

/// Seconds after which such a picture ends in any case, on a class of devices.
fn longest_seconds(kind: &str) -> f64 {
    match kind {
        "cpu" => 45.0,
        "discrete" => 1.0,
        _ => 10.0,
    }
}

impl RenderRequest {
    /// Of a scene, with everything else as usual.
    pub fn of(scene: impl Into<String>) -> RenderRequest {
        RenderRequest { scene: scene.into(), ..RenderRequest::default() }
    }

    /// Files that are read.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        [&self.map, &self.settings].into_iter().flatten().map(PathBuf::as_path).chain([Path::new(&self.scene)])
    }

    pub(super) fn reading(&self) -> Reading {
        Reading { radiometric: self.radiometric, at: self.at }
    }

    pub(super) fn surroundings(&self) -> Surroundings {
        let sun = self.sun.map(|SunPosition { azimuth, elevation }| [azimuth, elevation]);
        Surroundings { environment: self.environment.clone(), sun, rotate: self.environment_rotate, strength: self.environment_strength }
    }

    pub fn stop(&self) -> Stop {
        let usual = Stop::default();
        Stop {
            error: self.error.map(Percent::share),
            measure: self.measure.unwrap_or(usual.measure),
            confidence: self.confidence.map_or(usual.confidence, Percent::share),
            seconds: self.time.map(|Seconds(seconds)| seconds),
            photons: self.total_photons,
            ..usual
        }
    }

    /// Settings that are usual, or `tuned` before, but for what is asked for.
    pub fn settings(&self, tuned: Option<&SceneSettings>) -> SceneSettings {
        let usual = tuned.cloned().unwrap_or_default();
        let stop = self.stop();
        // As many as of the global map, unless something else is known.
        let caustic_photons = self.photons.filter(|_| tuned.is_none()).unwrap_or(usual.caustic_photons);
        let photons = self.photons.unwrap_or(usual.photons);
        let caustic_photons = self.caustic_photons.unwrap_or(caustic_photons);
        let most_rounds = || most_rounds(&stop, photons.min(caustic_photons)).unwrap_or(usual.rounds);
        let quarter = self.neighbours.map(|neighbours| (neighbours / 4).max(1));
        SceneSettings {
            photons,
            caustic_photons,
            rounds: self.rounds.unwrap_or_else(most_rounds),
            block: self.block.or(usual.block),
            bounces: self.bounces.unwrap_or(usual.bounces),
            seed: self.seed.unwrap_or(usual.seed),
            neighbours: self.neighbours.unwrap_or(usual.neighbours),
            caustic_neighbours: self.caustic_neighbours.or(quarter).unwrap_or(usual.caustic_neighbours),
            radius: self.radius,
            caustic_radius: self.caustic_radius,
            alpha: if self.fixed_radius { 1.0 } else { self.alpha.unwrap_or(usual.alpha) },
            kernel: self.kernel.unwrap_or(usual.kernel),
            edge_correction: self.edge_correction.unwrap_or(usual.edge_correction),
            samples: self.samples.unwrap_or(usual.samples),
            // Tiles with more samples were chosen together with those of all pixels.
            tiles: usual.tiles.filter(|_| self.samples.is_none()),
            shadow_rays: self.shadow_rays.unwrap_or(usual.shadow_rays),
            final_gather: self.final_gather,
            aim: self.aim.unwrap_or(usual.aim),
            illumination: self.illumination.unwrap_or(usual.illumination),
            part: self.part.unwrap_or(usual.part),
            keeps_parts: usual.keeps_parts,
            filter: self.filter.unwrap_or(usual.filter),
            builder: self.variant.and_then(Variant::builder).or(usual.builder),
            math: self.math.unwrap_or(usual.math),
            paranoid: self.paranoid,
            stop,
            group_size: self.group_size.unwrap_or(usual.group_size),
            chunk: self.chunk,
            with: self.with.clone(),
            without: self.without.clone(),
        }
    }

    /// Whether nothing says when a run ends.
    pub fn has_no_end(&self) -> bool {
        let is_given = self.rounds.is_some() || self.map.is_some() || self.shard.is_some() || self.settings.is_some();
        !self.stop().is_set() && !is_given
    }

    /// The same settings with an end for a picture of which nothing says when it ends: an error, and a time by the class of device.
    pub(super) fn ended(&self, settings: SceneSettings, kind: &str) -> SceneSettings {
        if !self.has_no_end() {
            return settings;
        }
        let stop = Stop { error: Some(GOOD_ERROR), seconds: Some(longest_seconds(kind)), ..settings.stop };
        SceneSettings { stop, rounds: MOST_ROUNDS, ..settings }
    }

    /// What a pilot may choose of a run that ends at an error or a time; shards must not choose each for itself.
    pub(super) fn tunable(&self, of_picture: bool) -> TunableSettings {
        let is_fixed = self.rounds.is_some() || self.total_photons.is_some() || self.shard.is_some() || self.settings.is_some();
        if is_fixed {
            return TunableSettings::default();
        }
        let traces = self.map.is_none();
        TunableSettings {
            samples: of_picture && self.samples.is_none(),
            shadow_rays: self.shadow_rays.is_none(),
            photons: traces && self.photons.is_none(),
            caustic_photons: traces && self.caustic_photons.is_none(),
            neighbours: self.neighbours.is_none() && self.radius.is_none(),
            caustic_neighbours: self.caustic_neighbours.is_none() && self.neighbours.is_none() && self.caustic_radius.is_none(),
        }
    }
}

/// Most rounds of a run with a stop criterion, if there is one; `photons` are those of the smaller map per round.
fn most_rounds(stop: &Stop, photons: u32) -> Option<u32> {
    let by_total = |total: u64| total.div_ceil(u64::from(photons.max(1))).clamp(1, u64::from(MAX_ROUNDS)) as u32;
    stop.is_set().then(|| stop.photons.map_or(MOST_ROUNDS, by_total))
}
