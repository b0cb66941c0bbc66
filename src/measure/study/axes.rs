//! The options that a study compares: axes, and the configurations along each.

use serde::{Deserialize, Serialize};

use crate::rng::Rng;
use crate::settings::scene::{Effect, Illumination, Kernel, SceneSettings};
use crate::settings::{Builder, Gather, Math, RoomSettings, Sums};

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    Builder,
    Photons,
    Radius,
    Schedule,
    Kernel,
    Nearest,
    Edges,
    Bounces,
    Randomness,
    Sums,
    Arithmetic,
    Direct,
    Paths,
    Gather,
    Index,
    Effects,
    Paper,
}

impl Axis {
    pub fn name(self) -> &'static str {
        match self {
            Axis::Builder => "builder",
            Axis::Photons => "photons per round",
            Axis::Radius => "radius",
            Axis::Schedule => "radius schedule",
            Axis::Kernel => "kernel",
            Axis::Nearest => "nearest photons",
            Axis::Edges => "edge correction",
            Axis::Bounces => "bounces",
            Axis::Randomness => "random numbers",
            Axis::Sums => "sums",
            Axis::Arithmetic => "arithmetic",
            Axis::Direct => "direct light",
            Axis::Paths => "paths per pixel",
            Axis::Gather => "final gather",
            Axis::Index => "index",
            Axis::Effects => "effects",
            Axis::Paper => "the paper's rounds",
        }
    }
}

/// Which of the two lines, and how.
#[derive(Debug, Clone, PartialEq)]
pub enum Line {
    /// The paper's box.
    Paper(RoomSettings),
    /// A scene of triangles.
    Scene(SceneSettings),
}

#[derive(Debug, Clone, PartialEq)]
pub struct Configuration {
    pub label: String,
    pub line: Line,
}

/// What is measured in turn, so that a clock that drifts touches all alike: the base, then its alternatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    pub axis: Axis,
    pub configurations: Vec<Configuration>,
}

impl Configuration {
    /// Rounds that sums and random numbers allow.
    pub fn most_rounds(&self) -> u32 {
        match &self.line {
            Line::Paper(settings) => settings.most_rounds(),
            Line::Scene(_) => 1 << 20,
        }
    }
}

/// Alternatives to a base, axis by axis.
struct Sweep<S> {
    base: S,
    label: String,
    wrap: fn(S) -> Line,
    groups: Vec<Group>,
}

impl<S: Clone + PartialEq> Sweep<S> {
    fn new(base: S, label: &str, wrap: fn(S) -> Line) -> Sweep<S> {
        Sweep { base, label: label.to_owned(), wrap, groups: Vec::new() }
    }

    /// One more choice; what the base has already is not measured again.
    fn add(&mut self, axis: Axis, label: impl Into<String>, change: impl FnOnce(&mut S)) {
        let mut settings = self.base.clone();
        change(&mut settings);
        if settings == self.base {
            return;
        }
        if self.groups.last().is_none_or(|group| group.axis != axis) {
            let base = Configuration { label: self.label.clone(), line: (self.wrap)(self.base.clone()) };
            self.groups.push(Group { axis, configurations: vec![base] });
        }
        let configuration = Configuration { label: label.into(), line: (self.wrap)(settings) };
        self.groups.last_mut().expect("pushed above").configurations.push(configuration);
    }
}

/// Irradiance of the walls by the paper's line.
pub fn of_paper(mesh: u32, photons: u32) -> Vec<Group> {
    let base = RoomSettings { mesh, photons, rng: Rng::Philox, radius: 0.025, bounces: 30, ..RoomSettings::default() };
    let base = RoomSettings { full_light: base.full_light_for(photons), ..base };
    let mut sweep = Sweep::new(base, "atomic, grid, radius 0.025 m, 30 bounces, philox", Line::Paper);
    sweep.add(Axis::Builder, "naive slots", |s| s.builder = Builder::Naive);
    sweep.add(Axis::Builder, "subgroup ballot", |s| s.builder = Builder::Ballot);
    sweep.add(Axis::Builder, "work-group aggregate", |s| s.builder = Builder::Group);
    sweep.add(Axis::Builder, "prefix sums, order kept", |s| s.builder = Builder::Scan);
    sweep.add(Axis::Builder, "persistent", |s| s.builder = Builder::Persistent);
    sweep.add(Axis::Builder, "CPU, one thread", |s| s.builder = Builder::Cpu);
    for (factor, name) in [(16, "1/16 of the photons"), (4, "1/4 of the photons")] {
        sweep.add(Axis::Photons, name, |s| s.photons = (photons / factor).max(2));
    }
    sweep.add(Axis::Photons, "4 times the photons", |s| s.photons = photons * 4);
    for radius in [0.1, 0.05, 0.0125, 0.00625] {
        sweep.add(Axis::Radius, format!("radius {radius} m"), |s| s.radius = radius);
    }
    for nearest in [10, 50, 200] {
        sweep.add(Axis::Nearest, format!("the {nearest} nearest photons within 0.1 m, kd-tree"), |s| {
            (s.gather, s.nearest, s.radius) = (Gather::KdTree, Some(nearest), 0.1);
        });
    }
    sweep.add(Axis::Edges, "no edge correction", |s| s.edge_correction = false);
    for bounces in [2, 5, 15, 60] {
        sweep.add(Axis::Bounces, format!("{bounces} bounces"), |s| s.bounces = bounces);
    }
    sweep.add(Axis::Randomness, "rand48", |s| s.rng = Rng::Rand48);
    sweep.add(Axis::Randomness, "Mersenne Twister", |s| s.rng = Rng::Mt);
    sweep.add(Axis::Randomness, "Owen-scrambled Sobol'", |s| s.rng = Rng::Sobol);
    sweep.add(Axis::Sums, "32-bit floats", |s| s.sums = Sums::F32);
    sweep.add(Axis::Sums, "compensated floats", |s| s.sums = Sums::Compensated);
    sweep.add(Axis::Arithmetic, "strict", |s| s.math = Math::Strict);
    sweep.add(Axis::Index, "brute force", |s| s.gather = Gather::Brute);
    sweep.add(Axis::Index, "kd-tree", |s| s.gather = Gather::KdTree);
    sweep.groups
}

/// The paper's figure 4 and table 1: rounds of 5000 photons, at its two radii and another, and by the line of scenes,
/// whose radius may shrink.
pub fn of_the_papers_rounds(mesh: u32) -> Vec<Group> {
    let base = RoomSettings { mesh, radius: 0.025, rounds: 1, ..RoomSettings::default() };
    let mut sweep = Sweep::new(base, "radius 0.025 m", Line::Paper);
    sweep.add(Axis::Paper, "radius 0.05 m", |s| s.radius = 0.05);
    sweep.add(Axis::Paper, "radius 0.0125 m", |s| s.radius = 0.0125);
    let triangles = |alpha: f64| SceneSettings {
        photons: 5000,
        caustic_photons: 5000,
        bounces: 15,
        radius: Some(0.05),
        illumination: Illumination::Photons,
        alpha,
        ..SceneSettings::default()
    };
    let shrinking = [(1.0, "radius 0.05 m, box as triangles"), (2.0 / 3.0, "radius shrinking from 0.05 m (alpha 2/3), box as triangles")]
        .map(|(alpha, label)| Configuration { label: label.to_owned(), line: Line::Scene(triangles(alpha)) });
    sweep.groups[0].configurations.extend(shrinking);
    sweep.groups
}

/// Light that a picture may do without, if the scene has it.
const REMOVABLE: [Effect; 5] =
    [Effect::Indirect, Effect::Glossy, Effect::ReflectiveCaustics, Effect::RefractiveCaustics, Effect::SmoothNormals];

/// Whatever a scene of triangles may be lit by: `kept` are the effects that it calls for, `radius` that of its global
/// map in metres, if it has one, `has_few_triangles` says whether a list of them may be tested from end to end, and
/// `is_picture` whether a camera looks.
pub fn of_scene(photons: u32, kept: &[Effect], radius: Option<f64>, has_few_triangles: bool, is_picture: bool) -> Vec<Group> {
    let base = SceneSettings { photons, caustic_photons: photons, ..SceneSettings::default() };
    let mut sweep = Sweep::new(base, "persistent, shrinking radius, shadow rays", Line::Scene);
    sweep.add(Axis::Builder, "naive slots", |s| s.builder = Some(Builder::Naive));
    sweep.add(Axis::Builder, "atomic", |s| s.builder = Some(Builder::Atomic));
    sweep.add(Axis::Builder, "subgroup ballot", |s| s.builder = Some(Builder::Ballot));
    sweep.add(Axis::Builder, "work-group aggregate", |s| s.builder = Some(Builder::Group));
    sweep.add(Axis::Builder, "prefix sums, order kept", |s| s.builder = Some(Builder::Scan));
    let of_photons = |s: &mut SceneSettings, photons: u32| (s.photons, s.caustic_photons) = (photons, photons);
    sweep.add(Axis::Photons, "1/16 of the photons", |s| of_photons(s, (photons / 16).max(1)));
    sweep.add(Axis::Photons, "1/4 of the photons", |s| of_photons(s, (photons / 4).max(1)));
    sweep.add(Axis::Photons, "4 times the photons", |s| of_photons(s, photons * 4));
    for (factor, name) in [(2.0, "twice the radius"), (0.5, "half the radius")] {
        if let Some(radius) = radius {
            sweep.add(Axis::Radius, name, |s| s.radius = Some(significant(factor * radius)));
        }
    }
    for alpha in [0.5, 0.8, 1.0] {
        let label = if alpha == 1.0 { "fixed radius".to_owned() } else { format!("alpha {alpha}") };
        sweep.add(Axis::Schedule, label, |s| s.alpha = alpha);
    }
    sweep.add(Axis::Kernel, "cone", |s| s.kernel = Kernel::Cone);
    sweep.add(Axis::Kernel, "Epanechnikov", |s| s.kernel = Kernel::Epanechnikov);
    sweep.add(Axis::Edges, "no edge correction", |s| s.edge_correction = false);
    for bounces in [2, 5, 15] {
        sweep.add(Axis::Bounces, format!("{bounces} bounces"), |s| s.bounces = bounces);
    }
    sweep.add(Axis::Arithmetic, "strict", |s| s.math = Math::Strict);
    sweep.add(Axis::Direct, "one shadow ray", |s| s.shadow_rays = 1);
    sweep.add(Axis::Direct, "16 shadow rays", |s| s.shadow_rays = 16);
    sweep.add(Axis::Direct, "direct light from photons", |s| s.illumination = Illumination::Photons);
    if is_picture {
        for samples in [4, 16] {
            sweep
                .add(Axis::Paths, format!("{samples} paths per pixel, one shadow ray each"), |s| (s.samples, s.shadow_rays) = (samples, 1));
        }
    }
    sweep.add(Axis::Gather, "final gather", |s| s.final_gather = true);
    if has_few_triangles {
        sweep.add(Axis::Index, "no BVH", |s| s.without = vec![Effect::Bvh]);
    }
    sweep.add(Axis::Effects, "all effects forced on", |s| s.with = Effect::ALL.to_vec());
    for effect in REMOVABLE.into_iter().filter(|effect| kept.contains(effect)) {
        sweep.add(Axis::Effects, format!("without {}", effect.name()), |s| s.without = vec![effect]);
    }
    sweep.groups
}

/// Three digits, as people write them.
fn significant(value: f64) -> f64 {
    format!("{value:.2e}").parse().expect("a number was written")
}
