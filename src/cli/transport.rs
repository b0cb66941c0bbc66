//! What the commands that light a scene of triangles share: options, the scene, the run.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};

use super::run::{number, numbers, whole};
use super::stop::{ProgressArg, StopArgs, Teller, bias_before, rounds_after};
use super::{DeviceArgs, TimingArgs, complain, hearing};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::destination::Destination;
use crate::output::light_report;
use crate::output::trace_file;
use crate::plan::transport::{Sensor, TransportPlan};
use crate::records::Receiver;
use crate::render::stop::mean_squared_radius;
use crate::render::{Control, Progress};
use crate::scene::geometry::Geometry;
use crate::scene::light::{Light, LightKind};
use crate::scene::{Camera, Scene};
use crate::settings::Math;
use crate::settings::transport::{Append, Effect, Filter, Illumination, Kernel, MAX_ROUNDS, Part, Stop, TransportSettings};
use crate::transport::replay::PhotonName;
use crate::transport::{self, Lit, View};

#[derive(Args)]
pub(super) struct SceneArgs {
    /// A built-in scene by name, or a .gltf or .glb file
    #[arg(value_name = "SCENE")]
    pub(super) scene: String,
    /// Punctual lights of a glTF file are in W/sr and W/m2 already [default: candela and lux, divided by
    /// 683 lm/W]
    #[arg(long, help_heading = "Scene")]
    radiometric: bool,
    /// Light from everywhere beyond the scene, W/m2/sr: one number, or three for red, green, blue
    #[arg(long, value_name = "R,G,B", value_parser = colour, allow_hyphen_values = true, help_heading = "Scene")]
    environment: Option<[f32; 3]>,
}

#[derive(Args)]
pub(super) struct TransportArgs {
    /// Photons of the global map, each round [default: 131072]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    photons: Option<u32>,
    /// Photons of the caustic map, each round [default: as --photons]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    caustic_photons: Option<u32>,
    /// Independent rounds, of which the result is the mean [default: 16; 65536 at most with --error or
    /// --time, and as many as --total-photons takes]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    rounds: Option<u32>,
    /// Most bounces of a photon [default: 32]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    bounces: Option<u32>,
    /// Seed of the random numbers [default: 1]
    #[arg(long, value_parser = whole::<u64>, allow_negative_numbers = true, help_heading = "Transport")]
    seed: Option<u64>,
    /// Shadow rays from each visible point, each round [default: 4]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    shadow_rays: Option<u32>,
    /// Take indirect light from a ray to the next surface instead of the map where the camera looks
    #[arg(long, help_heading = "Transport")]
    final_gather: bool,
    /// Send photons of the caustic map only towards mirrors and glass [default: on]
    #[arg(long, value_enum, help_heading = "Transport")]
    aim: Option<super::run::SwitchArg>,
    /// Where direct light and caustics come from: shadow rays and a map of their own, or all of it from one
    /// photon map, as in the paper [default: split]
    #[arg(long, value_enum, help_heading = "Transport")]
    illumination: Option<IlluminationArg>,
    /// How photons fly and take places in their map; the result is the same to the bit. auto: persistent, or ballot with
    /// --math strict, or where photons may bounce more often than the device lets a loop go on [default: auto]
    #[arg(long, value_enum, help_heading = "Transport")]
    variant: Option<AppendArg>,
    /// Arithmetic: as fast as the device has it, or the same bits on every device that rounds to nearest [default: fast]
    #[arg(long, value_enum, help_heading = "Transport")]
    math: Option<super::run::MathArg>,
    #[command(flatten)]
    pub(super) stop: StopArgs,
    /// Most photons traced at once; the result is the same to the bit [default: what the device holds]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    chunk: Option<u32>,
    /// Invocations of a work group, a power of two [default: 128]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Transport")]
    group_size: Option<u32>,

    /// Radius of the global map's estimate in the first round, metres [default: by a trial round, so that
    /// about 24 photons lie within it at the median of the points that are asked about]
    #[arg(long, value_parser = number::<f64>, allow_negative_numbers = true, help_heading = "Estimate")]
    radius: Option<f64>,
    /// The same of the caustic map [default: by the same trial, for 6 photons]
    #[arg(long, value_parser = number::<f64>, allow_negative_numbers = true, help_heading = "Estimate")]
    caustic_radius: Option<f64>,
    /// How fast the radius shrinks from round to round (Knaus and Zwicker 2011), above 0; 1 keeps it
    /// [default: 0.667]
    #[arg(long, value_parser = number::<f64>, allow_negative_numbers = true, help_heading = "Estimate", conflicts_with = "fixed_radius")]
    alpha: Option<f64>,
    /// Keep the radius, as `--alpha 1` does
    #[arg(long, help_heading = "Estimate")]
    fixed_radius: bool,
    /// How a photon's weight falls with its distance [default: box]
    #[arg(long, value_enum, help_heading = "Estimate")]
    kernel: Option<KernelArg>,
    /// Divide by the area that really lies on the surface [default: on]
    #[arg(long, value_enum, help_heading = "Estimate")]
    edge_correction: Option<super::run::SwitchArg>,

    /// Look on the device for values that are infinite or no number, and say whose they are
    #[arg(long, help_heading = "Output")]
    paranoid: bool,
    /// Simulate an effect even where the scene does not need it; see `photonmill plan`
    #[arg(long, value_name = "EFFECT", value_enum, value_delimiter = ',', help_heading = "Plan")]
    with: Vec<EffectArg>,
    /// Leave an effect out, even where the scene needs it
    #[arg(long, value_name = "EFFECT", value_enum, value_delimiter = ',', help_heading = "Plan")]
    without: Vec<EffectArg>,
}

/// What a run tells beside its result.
#[derive(Args)]
pub(super) struct ReportArgs {
    /// Print which effects were kept or dropped and why, what each cost and gave
    #[arg(long, help_heading = "Output")]
    explain: bool,
    /// How far the run has come: a bar on a terminal, or lines of JSON on stderr
    #[arg(long, value_enum, default_value = "bar", help_heading = "Output")]
    pub(super) progress: ProgressArg,
    /// Report as JSON
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    json: Option<PathBuf>,
    /// Chrome trace of all passes, for Perfetto
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    trace: Option<PathBuf>,
    #[command(flatten)]
    timing: TimingArgs,
}

super::run::value_enum!(IlluminationArg => Illumination { Split, Photons });
super::run::value_enum!(AppendArg => Append { Auto, Atomic, Ballot, Persistent });
super::run::value_enum!(KernelArg => Kernel { Box, Cone, Epanechnikov });
super::run::value_enum!(FilterArg => Filter { Box, Tent, Gaussian });
super::run::value_enum!(PartArg => Part { All, Direct, Specular, Caustic, Indirect });
super::run::value_enum!(EffectArg => Effect {
    Direct, Indirect, Glossy, ReflectiveCaustics, RefractiveCaustics, SpecularChains, Textures, Environment, MeshLights,
    PointLights, SpotLights, DirectionalLights, DiscLights, Bvh, TwoSided, SmoothNormals,
});

/// Rounds of a run that ends by itself.
const MOST_ROUNDS: u32 = 65_536;

/// Rounds that a run may take which ends by itself; one map at least has so many photons a round.
fn most_rounds(stop: &Stop, photons: u32) -> Option<u32> {
    let by_total = |total: u64| total.div_ceil(u64::from(photons.max(1))).clamp(1, u64::from(MAX_ROUNDS)) as u32;
    stop.is_set().then(|| stop.photons.map_or(MOST_ROUNDS, by_total))
}

/// `3:4711`, `3:4711:caustic`.
pub(super) fn photon_name(text: &str) -> std::result::Result<PhotonName, String> {
    let (numbers, caustic) = text.strip_suffix(":caustic").map_or((text, false), |numbers| (numbers, true));
    let parsed = numbers.split_once(':').and_then(|(round, photon)| Some((round.parse().ok()?, photon.parse().ok()?)));
    parsed
        .map(|(round, photon)| PhotonName { round, photon, caustic })
        .ok_or_else(|| "must be ROUND:PHOTON, two whole numbers, or ROUND:PHOTON:caustic".to_owned())
}

fn colour(text: &str) -> std::result::Result<[f32; 3], String> {
    let all = match numbers::<f32, 1>(text) {
        Ok([grey]) => [grey; 3],
        Err(_) => numbers::<f32, 3>(text).map_err(|_| "must be one number, or three with commas between".to_owned())?,
    };
    if all.iter().all(|value| value.is_finite() && *value >= 0.0) { Ok(all) } else { Err("must be 0 or more".to_owned()) }
}

impl SceneArgs {
    /// The scene, its warnings told.
    pub(super) fn open(&self) -> Result<Scene> {
        let mut scene = Scene::open(&self.scene, self.radiometric)?;
        if let Some(radiance) = self.environment {
            scene.lights.push(Light { name: "--environment".into(), kind: LightKind::Environment { radiance: radiance.into() } });
        }
        for warning in &scene.warnings {
            complain(&format!("warning: {warning}"));
        }
        if !scene.is_lit() {
            complain("warning: nothing shines in this scene: it is dark");
        }
        Ok(scene)
    }
}

impl TransportArgs {
    pub(super) fn settings(&self) -> TransportSettings {
        let usual = TransportSettings::default();
        let photons = self.photons.unwrap_or(usual.photons);
        let caustic_photons = self.caustic_photons.unwrap_or(photons);
        let stop = self.stop.stop();
        TransportSettings {
            photons,
            caustic_photons,
            rounds: self.rounds.unwrap_or_else(|| most_rounds(&stop, photons.min(caustic_photons)).unwrap_or(usual.rounds)),
            stop,
            bounces: self.bounces.unwrap_or(usual.bounces),
            seed: self.seed.unwrap_or(usual.seed),
            radius: self.radius,
            caustic_radius: self.caustic_radius,
            alpha: if self.fixed_radius { 1.0 } else { self.alpha.unwrap_or(usual.alpha) },
            kernel: self.kernel.map_or(usual.kernel, Kernel::from),
            edge_correction: self.edge_correction.map_or(usual.edge_correction, |switch| switch == super::run::SwitchArg::On),
            shadow_rays: self.shadow_rays.unwrap_or(usual.shadow_rays),
            final_gather: self.final_gather,
            aim: self.aim.map_or(usual.aim, |switch| switch == super::run::SwitchArg::On),
            illumination: self.illumination.map_or(usual.illumination, Illumination::from),
            append: self.variant.map_or(usual.append, Append::from),
            math: self.math.map_or(usual.math, Math::from),
            paranoid: self.paranoid,
            group_size: self.group_size.unwrap_or(usual.group_size),
            chunk: self.chunk,
            with: self.with.iter().map(|effect| (*effect).into()).collect(),
            without: self.without.iter().map(|effect| (*effect).into()).collect(),
            ..usual
        }
    }
}

/// The outputs of [`ReportArgs`], checked before the run.
pub(super) struct Reports {
    pub(super) explain: bool,
    json: Option<Destination>,
    trace: Option<Destination>,
}

impl ReportArgs {
    pub(super) fn open(&self) -> Result<Reports> {
        let file = |option, path: &Option<PathBuf>| path.as_ref().map(|path| Destination::open(option, path)).transpose();
        Ok(Reports { explain: self.explain, json: file("--json", &self.json)?, trace: file("--trace", &self.trace)? })
    }

    /// The device; a scene of triangles needs one.
    pub(super) fn device(&self, device: &DeviceArgs) -> Result<Gpu> {
        Gpu::open(&self.timing.options(device))
    }
}

impl Reports {
    pub(super) fn destinations(&self) -> Vec<Destination> {
        [&self.json, &self.trace].into_iter().flatten().cloned().collect()
    }

    pub(super) fn files(self, scene: &Scene, lit: &Lit) -> Vec<(Destination, Vec<u8>)> {
        let json = self.json.map(|json| (json, light_report::json(&scene.name, lit)));
        let trace = self.trace.map(|trace| (trace, trace_file::chrome_trace(&lit.timings, &lit.device.name)));
        json.into_iter().chain(trace).collect()
    }
}

/// What a run is about.
pub(super) struct Job<'a> {
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a TransportSettings,
    pub(super) sensor: Sensor,
    pub(super) camera: Option<&'a Camera>,
    pub(super) phases: &'a [Vec<Receiver>],
}

/// The plan of a job, its default radii by a trial round.
pub(super) fn plan(gpu: &Gpu, job: &Job, geometry: &Geometry) -> Result<TransportPlan> {
    let view = View { geometry, camera: job.camera, phases: job.phases };
    let plan = transport::trial::plan(gpu, job.scene, &view, job.settings, job.sensor)?;
    if let Some(warning) = light_report::radius_warning(&plan, geometry) {
        complain(&format!("warning: {warning}"));
    }
    Ok(plan)
}

/// Geometry of a scene without the effects that are left out.
pub(super) fn geometry(scene: &Scene, settings: &TransportSettings) -> Result<Geometry> {
    let geometry = Geometry::new(&scene.without(&settings.without))?;
    if geometry.left_out > 0 {
        complain(&format!(
            "warning: {} triangle(s) have no area in single precision, or lie on others, and are left out",
            geometry.left_out
        ));
    }
    Ok(geometry)
}

/// Runs all rounds, and tells how far it has come; with `bias`, measures that too.
pub(super) fn light(
    gpu: &Gpu,
    job: &Job,
    geometry: &Geometry,
    mut plan: TransportPlan,
    (told, bias): (ProgressArg, bool),
    cancelled: &AtomicBool,
) -> Result<Lit> {
    let view = View { geometry, camera: job.camera, phases: job.phases };
    let of_first = |plan: &TransportPlan, factor_and_rounds| {
        hearing(|| transport::bias::measure(gpu, job.scene, &view, plan, factor_and_rounds, cancelled))
    };
    let alpha = plan.settings.alpha;
    let stop = plan.settings.stop;
    // An error that is wanted is one of noise and bias together, so that the bias must be known beforehand.
    let before = match stop.error.filter(|_| bias) {
        Some(wanted) => bias_before(wanted, alpha < 1.0, |rounds| of_first(&plan, (1.0, rounds)))?,
        None => None,
    };
    plan.settings.stop.bias = before.map(|bias| bias.upper);

    let teller = Teller::new(told, "rounds");
    let mut tell = |progress: &Progress| teller.tell(progress);
    let mut control = Control { cancelled, progress: &mut tell };
    let mut lit = hearing(|| transport::light(gpu, &view, plan, &mut control))?;
    teller.finish();
    if lit.end == transport::End::Cancelled {
        complain(&format!("ended after {} of {} rounds; what is written is of these", lit.film.rounds, lit.plan.settings.rounds));
        return Ok(lit);
    }
    let shrunk = mean_squared_radius(alpha, lit.film.rounds);
    lit.bias = match before {
        Some(bias) => Some(bias.scaled(shrunk)),
        // At the radius whose square is the mean of the rounds' squares.
        None if bias => of_first(&lit.plan, (shrunk.sqrt(), rounds_after(lit.film.rounds)))?,
        None => None,
    };
    Ok(lit)
}

/// Of a picture; numbers of its sums are 32-bit.
const MAX_PIXELS: u32 = 1 << 28;

/// `800x600`.
pub(super) fn size(text: &str) -> std::result::Result<(u32, u32), String> {
    let parsed = text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    parsed
        .filter(|(width, height): &(u32, u32)| (1..=65_535).contains(width) && (1..=65_535).contains(height))
        .filter(|(width, height)| width * height <= MAX_PIXELS)
        .ok_or_else(|| format!("must be WIDTHxHEIGHT, each from 1 to 65535, and {MAX_PIXELS} pixels at most"))
}

/// The camera by name, else the scene's first, else one that sees all of it.
pub(super) fn camera(scene: &Scene, name: Option<&str>) -> Result<Camera> {
    match name {
        Some(name) => scene.cameras.iter().find(|camera| camera.name == name).cloned().ok_or_else(|| {
            let names: Vec<&str> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
            let there = if names.is_empty() {
                "the scene has none; leave --camera out".to_owned()
            } else {
                format!("must be one of {}", names.join(", "))
            };
            Error::setting("--camera", name, there)
        }),
        None => Ok(scene.cameras.first().cloned().unwrap_or_else(|| {
            let (min, max) = scene.bounds();
            Camera::around(min, max)
        })),
    }
}
