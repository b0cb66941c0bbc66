//! The options that a study compares: axes, and the configurations along each.

use serde::{Deserialize, Serialize};

use crate::render::RenderRequest;
use crate::render::values::Variant;
use crate::rng::Rng;
use crate::settings::scene::{Effect, Illumination, Kernel};
use crate::settings::{Builder, Gather, Math, Sums};

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Axis {
    /// Runs that an error ends, with nothing set.
    Default,
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
    pub(crate) fn name(self) -> &'static str {
        match self {
            Axis::Default => "default settings",
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

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Configuration {
    pub label: String,
    /// Without a scene: of the paper's box.
    pub request: RenderRequest,
}

/// What is measured in turn, so that a clock that drifts touches all alike: the base, then its alternatives.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Group {
    pub axis: Axis,
    pub configurations: Vec<Configuration>,
}

impl Configuration {
    /// Rounds that sums and random numbers allow.
    pub(crate) fn most_rounds(&self) -> u32 {
        if self.is_of_paper() { self.request.room_settings().most_rounds() } else { 1 << 20 }
    }

    pub(crate) fn request_of(&self, rounds: u32, seed: u64) -> RenderRequest {
        RenderRequest { rounds: Some(rounds), seed: Some(seed), ..self.request.clone() }
    }

    /// Whether it is of the paper's box.
    pub(crate) fn is_of_paper(&self) -> bool {
        self.request.scene.is_empty()
    }
}

/// Alternatives to a base, axis by axis.
struct Sweep {
    base: RenderRequest,
    label: String,
    groups: Vec<Group>,
}

impl Sweep {
    fn new(base: RenderRequest, label: &str) -> Sweep {
        Sweep { base, label: label.to_owned(), groups: Vec::new() }
    }

    /// One more choice; what the base has already is not measured again.
    fn add(&mut self, axis: Axis, label: impl Into<String>, change: impl FnOnce(&mut RenderRequest)) {
        let mut request = self.base.clone();
        change(&mut request);
        if request.brief() == self.base.brief() {
            return;
        }
        if self.groups.last().is_none_or(|group| group.axis != axis) {
            let base = Configuration { label: self.label.clone(), request: self.base.clone() };
            self.groups.push(Group { axis, configurations: vec![base] });
        }
        let configuration = Configuration { label: label.into(), request };
        self.groups.last_mut().expect("pushed above").configurations.push(configuration);
    }

    /// A choice for each value.
    fn each<T>(&mut self, axis: Axis, choices: impl IntoIterator<Item = (impl Into<String>, T)>, change: impl Fn(&mut RenderRequest, T)) {
        choices.into_iter().for_each(|(label, value)| self.add(axis, label, |request| change(request, value)));
    }
}

/// Those that are alternatives to the base in both worlds.
const BUILDERS: [(&str, Builder); 5] = [
    ("naive slots", Builder::Naive),
    ("atomic", Builder::Atomic),
    ("subgroup ballot", Builder::Ballot),
    ("work-group aggregate", Builder::Group),
    ("prefix sums, order kept", Builder::Scan),
];

fn photon_counts(photons: u32) -> [(&'static str, u32); 3] {
    [("1/16 of the photons", (photons / 16).max(2)), ("1/4 of the photons", (photons / 4).max(2)), ("4 times the photons", photons * 4)]
}

fn bounce_counts<const COUNT: usize>(bounces: [u32; COUNT]) -> [(String, u32); COUNT] {
    bounces.map(|bounces| (format!("{bounces} bounces"), bounces))
}

/// Irradiance of the walls of the paper's room.
pub(crate) fn of_paper(mesh: u32, photons: u32) -> Vec<Group> {
    let (radius, bounces, rng) = (Some(0.025), Some(30), Some(Rng::Philox));
    let base = RenderRequest { mesh: Some(mesh), photons: Some(photons), radius, bounces, rng, ..RenderRequest::default() };
    let mut sweep = Sweep::new(base, "atomic, grid, radius 0.025 m, 30 bounces, philox");
    let others = [("persistent", Builder::Persistent), ("CPU, one thread", Builder::Cpu)];
    sweep.each(Axis::Builder, BUILDERS.into_iter().chain(others), |s, builder| s.variant = Some(Variant::Of(builder)));
    sweep.each(Axis::Photons, photon_counts(photons), |s, photons| s.photons = Some(photons));
    sweep.each(Axis::Radius, [0.1, 0.05, 0.0125, 0.00625].map(|radius| (format!("radius {radius} m"), radius)), |s, r| s.radius = Some(r));
    for nearest in [10, 50, 200] {
        sweep.add(Axis::Nearest, format!("the {nearest} nearest photons within 0.1 m, kd-tree"), |s| {
            (s.gather, s.nearest, s.radius) = (Some(Gather::KdTree), Some(nearest), Some(0.1));
        });
    }
    sweep.add(Axis::Edges, "no edge correction", |s| s.edge_correction = Some(false));
    sweep.each(Axis::Bounces, bounce_counts([2, 5, 15, 60]), |s, bounces| s.bounces = Some(bounces));
    let generators = [("rand48", Rng::Rand48), ("Mersenne Twister", Rng::Mt), ("Owen-scrambled Sobol'", Rng::Sobol)];
    sweep.each(Axis::Randomness, generators, |s, rng| s.rng = Some(rng));
    sweep.each(Axis::Sums, [("32-bit floats", Sums::F32), ("compensated floats", Sums::Compensated)], |s, sums| s.sums = Some(sums));
    sweep.add(Axis::Arithmetic, "strict", |s| s.math = Some(Math::Strict));
    sweep.each(Axis::Index, [("brute force", Gather::Brute), ("kd-tree", Gather::KdTree)], |s, gather| s.gather = Some(gather));
    sweep.groups
}

/// The paper's figure 4 and table 1: rounds of 5000 photons, at its two radii and another, and by the line of scenes,
/// whose radius may shrink.
pub(crate) fn of_the_papers_rounds(mesh: u32) -> Vec<Group> {
    let base = RenderRequest { mesh: Some(mesh), radius: Some(0.025), ..RenderRequest::default() };
    let mut sweep = Sweep::new(base, "radius 0.025 m");
    sweep.each(Axis::Paper, [("radius 0.05 m", 0.05), ("radius 0.0125 m", 0.0125)], |s, radius| s.radius = Some(radius));
    let triangles = |alpha: f64| RenderRequest {
        photons: Some(5000),
        bounces: Some(15),
        radius: Some(0.05),
        illumination: Some(Illumination::Photons),
        alpha: Some(alpha),
        block: Some(1),
        ..RenderRequest::of("open-box")
    };
    let shrinking = [(1.0, "radius 0.05 m, box as triangles"), (2.0 / 3.0, "radius shrinking from 0.05 m (alpha 2/3), box as triangles")]
        .map(|(alpha, label)| Configuration { label: label.to_owned(), request: triangles(alpha) });
    sweep.groups[0].configurations.extend(shrinking);
    sweep.groups
}

/// Light that a picture may do without, if the scene has it.
const REMOVABLE: [Effect; 5] =
    [Effect::Indirect, Effect::Glossy, Effect::ReflectiveCaustics, Effect::RefractiveCaustics, Effect::SmoothNormals];

/// Whatever the scene of triangles of a request may be lit by: `kept` are the effects that it calls for, `radius` that of its global
/// map in metres, if it has one, `has_few_triangles` says whether a list of them may be tested from end to end, and
/// `is_picture` whether a camera looks.
pub(crate) fn of_scene(base: RenderRequest, kept: &[Effect], radius: Option<f64>, has_few_triangles: bool, is_picture: bool) -> Vec<Group> {
    let photons = base.settings(None).photons;
    let mut sweep = Sweep::new(base, "persistent, shrinking radius, shadow rays");
    sweep.each(Axis::Builder, BUILDERS, |s, builder| s.variant = Some(Variant::Of(builder)));
    sweep.each(Axis::Photons, photon_counts(photons), |s, photons| s.photons = Some(photons));
    if let Some(radius) = radius {
        let radii = [("twice the radius", 2.0 * radius), ("half the radius", 0.5 * radius)];
        sweep.each(Axis::Radius, radii, |s, radius| s.radius = Some(significant(radius)));
    }
    sweep.each(Axis::Schedule, [("alpha 0.5", 0.5), ("alpha 0.8", 0.8), ("fixed radius", 1.0)], |s, alpha| s.alpha = Some(alpha));
    sweep.each(Axis::Kernel, [("cone", Kernel::Cone), ("Epanechnikov", Kernel::Epanechnikov)], |s, kernel| s.kernel = Some(kernel));
    sweep.add(Axis::Edges, "no edge correction", |s| s.edge_correction = Some(false));
    sweep.each(Axis::Bounces, bounce_counts([2, 5, 15]), |s, bounces| s.bounces = Some(bounces));
    sweep.add(Axis::Arithmetic, "strict", |s| s.math = Some(Math::Strict));
    sweep.each(Axis::Direct, [("one shadow ray", 1), ("16 shadow rays", 16)], |s, rays| s.shadow_rays = Some(rays));
    sweep.add(Axis::Direct, "direct light from photons", |s| s.illumination = Some(Illumination::Photons));
    if is_picture {
        let paths = [4, 16].map(|samples| (format!("{samples} paths per pixel, one shadow ray each"), samples));
        sweep.each(Axis::Paths, paths, |s, samples| (s.samples, s.shadow_rays) = (Some(samples), Some(1)));
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
