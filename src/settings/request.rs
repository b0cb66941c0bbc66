//! What is asked of the light of a scene, and the settings that follow: what is not given is as usual, or a pilot's to choose.

use super::scene::{Effect, Filter, Illumination, Kernel, MAX_ROUNDS, Part, SceneSettings, Stop};
use super::{Builder, Math};

/// `None`: as usual. The fields are those of [`SceneSettings`], and the program's options of the same names.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    pub stop: Stop,
    pub rounds: Option<u32>,
    pub block: Option<u32>,
    pub photons: Option<u32>,
    /// As many as of the global map.
    pub caustic_photons: Option<u32>,
    pub bounces: Option<u32>,
    pub seed: Option<u64>,
    pub neighbours: Option<u32>,
    /// A quarter of `neighbours`, where these are given.
    pub caustic_neighbours: Option<u32>,
    pub radius: Option<f64>,
    pub caustic_radius: Option<f64>,
    pub alpha: Option<f64>,
    pub kernel: Option<Kernel>,
    pub edge_correction: Option<bool>,
    pub samples: Option<u32>,
    pub shadow_rays: Option<u32>,
    pub final_gather: bool,
    pub aim: Option<bool>,
    pub illumination: Option<Illumination>,
    pub part: Option<Part>,
    pub filter: Option<Filter>,
    pub builder: Option<Builder>,
    pub math: Option<Math>,
    pub paranoid: bool,
    pub group_size: Option<u32>,
    pub chunk: Option<u32>,
    pub with: Vec<Effect>,
    pub without: Vec<Effect>,
}

/// Most rounds of a run that ends at a goal other than a number of photons.
pub const MOST_ROUNDS: u32 = 65_536;
/// When a picture is good enough to be shown, where nothing says when it ends.
pub const GOOD_ERROR: f64 = 0.02;

/// Seconds after which such a picture ends in any case, on a class of devices.
pub fn longest_seconds(kind: &str) -> f64 {
    match kind {
        "cpu" => 45.0,
        "discrete" => 1.0,
        _ => 10.0,
    }
}

impl Request {
    /// Settings that are usual, or `chosen` before, but for what is asked for.
    pub fn settings(&self, chosen: Option<&SceneSettings>) -> SceneSettings {
        let usual = chosen.cloned().unwrap_or_default();
        // As many as of the global map, unless something else is known.
        let caustic_photons = self.photons.filter(|_| chosen.is_none()).unwrap_or(usual.caustic_photons);
        let photons = self.photons.unwrap_or(usual.photons);
        let caustic_photons = self.caustic_photons.unwrap_or(caustic_photons);
        let most_rounds = || most_rounds(&self.stop, photons.min(caustic_photons)).unwrap_or(usual.rounds);
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
            alpha: self.alpha.unwrap_or(usual.alpha),
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
            builder: self.builder.or(usual.builder),
            math: self.math.unwrap_or(usual.math),
            paranoid: self.paranoid,
            stop: self.stop,
            group_size: self.group_size.unwrap_or(usual.group_size),
            chunk: self.chunk,
            with: self.with.clone(),
            without: self.without.clone(),
        }
    }

    /// Whether nothing says when a run ends.
    pub fn has_no_end(&self) -> bool {
        !self.stop.is_set() && self.rounds.is_none()
    }
}

/// Most rounds of a run with a stop criterion, if there is one; `photons` are those of the smaller map per round.
fn most_rounds(stop: &Stop, photons: u32) -> Option<u32> {
    let by_total = |total: u64| total.div_ceil(u64::from(photons.max(1))).clamp(1, u64::from(MAX_ROUNDS)) as u32;
    stop.is_set().then(|| stop.photons.map_or(MOST_ROUNDS, by_total))
}
