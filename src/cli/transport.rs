//! What the commands that light a scene of triangles share: options, the scene, the run.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};

use super::interrupt::interruptible;
use super::progress::{ProgressArgs, ProgressReporter};
use super::stop::{StopArgs, bias_before, goals, rounds_after};
use super::values::{MathArg, SwitchArg, parse_colour, parse_integer, parse_number, parse_within, value_enum};
use super::{DeviceArgs, JsonArg, TimingArgs, complain, help, optional_file};
use crate::engine::Control;
use crate::engine::Progress;
use crate::engine::scene::{self, RunResult, View};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::destination::Destination;
use crate::output::scene_report;
use crate::output::trace_file;
use crate::plan::radius::mean_squared_radius;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::records::Receiver;
use crate::scene::geometry::Geometry;
use crate::scene::light::{Light, LightKind};
use crate::scene::{Camera, Scene};
use crate::settings::scene::{Effect, Filter, Illumination, Kernel, MAX_ROUNDS, Part, SceneSettings, Stop};
use crate::settings::{Builder, Math};
use crate::text::counted;

#[derive(Args)]
pub(super) struct SceneArgs {
    #[arg(value_name = "SCENE", help = help::scene())]
    pub(super) scene: String,
    /// Take the intensities of the lights of a glTF file as W/sr and W/m2 [default: candela and lux, divided by 683 lm/W]
    #[arg(long, help_heading = "Scene")]
    radiometric: bool,
    /// Uniform light from the environment, W/m2/sr: one number, or three for red, green and blue
    #[arg(long, value_name = "R,G,B", value_parser = parse_colour, allow_hyphen_values = true, help_heading = "Scene")]
    environment: Option<[f32; 3]>,
}

#[derive(Args)]
pub(super) struct TransportArgs {
    #[command(flatten)]
    pub(super) stop: StopArgs,

    /// Photons of the global map, per round [default: 131072]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    photons: Option<u32>,
    /// Photons of the caustic map, per round [default: the same as --photons]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    caustic_photons: Option<u32>,
    /// Number of independent rounds, of which the result is the mean [default: 16; with --error or --time up to 65536, with
    /// --total-photons as many as needed]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    rounds: Option<u32>,
    /// Cut photons off after this many bounces [default: none; Russian roulette ends paths]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    bounces: Option<u32>,
    /// Seed of the random numbers [default: 1]
    #[arg(long, value_name = "N", value_parser = parse_within(0..=u64::MAX), allow_hyphen_values = true, help_heading = "Photons")]
    seed: Option<u64>,
    /// Emit photons of the caustic map only towards mirrors and glass (projection maps) [default: on]
    #[arg(long, value_enum, value_name = "SWITCH", help_heading = "Photons")]
    aim: Option<SwitchArg>,

    /// Source of direct light and caustics [default: split]
    #[arg(long, value_enum, value_name = "METHOD", help_heading = "Light transport")]
    illumination: Option<IlluminationArg>,
    /// Shadow rays per visible point and round [default: 4]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Light transport")]
    shadow_rays: Option<u32>,
    /// Final gathering: take indirect light from one ray to the next surface, not from the map at the visible point
    #[arg(long, help_heading = "Light transport")]
    final_gather: bool,
    /// Simulate an effect even if the scene does not need it; `photonmill plan` lists them
    #[arg(long, value_name = "EFFECT", value_enum, value_delimiter = ',', help_heading = "Light transport")]
    with: Vec<EffectArg>,
    /// Leave an effect out even if the scene needs it
    #[arg(long, value_name = "EFFECT", value_enum, value_delimiter = ',', help_heading = "Light transport")]
    without: Vec<EffectArg>,

    /// Radius of the density estimate of the global map in the first round, metres [default: from a trial round,
    /// so that about 24 photons of a round lie within it at the median pixel, texel or point]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Density estimate")]
    radius: Option<f64>,
    /// The same for the caustic map [default: from the same trial round, for about 6 photons]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Density estimate")]
    caustic_radius: Option<f64>,
    /// How the radius shrinks from round to round, as alpha of Knaus and Zwicker (2011): above 0 and at most 1, which keeps the
    /// radius [default: 0.667]
    #[arg(long, value_name = "ALPHA", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Density estimate", conflicts_with = "fixed_radius")]
    alpha: Option<f64>,
    /// Keep the radius, like `--alpha 1`
    #[arg(long, help_heading = "Density estimate")]
    fixed_radius: bool,
    /// Kernel of the density estimate: weight of a photon by its distance [default: box]
    #[arg(long, value_enum, value_name = "KERNEL", help_heading = "Density estimate")]
    kernel: Option<KernelArg>,
    /// Divide by the part of the search disc that lies on the surface, not by the whole disc [default: on]
    #[arg(long, value_enum, value_name = "SWITCH", help_heading = "Density estimate")]
    edge_correction: Option<SwitchArg>,

    /// Builder of the photon maps; all give bit-identical results [default: auto]
    #[arg(long, value_enum, value_name = "BUILDER", help_heading = "Implementation")]
    variant: Option<BuilderArg>,
    /// Rounding of the arithmetic [default: fast]
    #[arg(long, value_enum, value_name = "ROUNDING", help_heading = "Implementation")]
    math: Option<MathArg>,
    /// Most photons traced at once; the result is the same to the bit [default: what fits on the device]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Implementation")]
    chunk: Option<u32>,
    /// Invocations per work group, a power of two [default: 128]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Implementation")]
    group_size: Option<u32>,

    /// Detect NaN and infinity, and print which photon, pixel, texel or point they come from
    #[arg(long, help_heading = "Checks")]
    paranoid: bool,
}

/// Reports of a run as files.
#[derive(Args)]
pub(super) struct ReportArgs {
    #[command(flatten)]
    json: JsonArg,
    /// Write the time of every pass as a Chrome trace, for Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    trace: Option<PathBuf>,
}

/// What a run prints.
#[derive(Args)]
pub(super) struct MessageArgs {
    /// Also print which effects were kept or dropped and why, with the time and the light of each
    #[arg(long, help_heading = "Messages")]
    pub(super) explain: bool,
    #[command(flatten)]
    pub(super) progress: ProgressArgs,
}

/// The device of a run and how it is timed.
#[derive(Args)]
pub(super) struct TimedDeviceArgs {
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    timing: TimingArgs,
}

value_enum!(IlluminationArg => Illumination {
    /// Direct light by shadow rays, caustics from a map of their own, the rest from the global map
    Split,
    /// Everything from one photon map, as in the paper
    Photons,
});

#[derive(Clone, Copy, ValueEnum)]
enum BuilderArg {
    /// Persistent; ballot with --math strict, and where the device fails the check of what persistent needs
    Auto,
    /// Bounce by bounce, one slot per photon and bounce, empty slots included
    Naive,
    /// Bounce by bounce, one atomic per photon
    Atomic,
    /// Bounce by bounce, one atomic per subgroup
    Ballot,
    /// Bounce by bounce, one atomic per work group
    Group,
    /// Bounce by bounce, photons in their original order, by prefix sums
    Scan,
    /// One invocation traces each photon from emission to its end
    Persistent,
}

impl BuilderArg {
    /// `None`: the plan chooses.
    fn builder(self) -> Option<Builder> {
        match self {
            BuilderArg::Auto => None,
            BuilderArg::Naive => Some(Builder::Naive),
            BuilderArg::Atomic => Some(Builder::Atomic),
            BuilderArg::Ballot => Some(Builder::Ballot),
            BuilderArg::Group => Some(Builder::Group),
            BuilderArg::Scan => Some(Builder::Scan),
            BuilderArg::Persistent => Some(Builder::Persistent),
        }
    }
}

value_enum!(KernelArg => Kernel { Box, Cone, Epanechnikov });
value_enum!(FilterArg => Filter {
    /// The square of the pixel
    Box,
    /// A tent two pixels wide
    Tent,
    /// A Gaussian with a standard deviation of half a pixel
    Gaussian,
});
value_enum!(PartArg => Part {
    /// The whole picture
    All,
    /// Lamps that are seen directly, and what lamps light directly
    Direct,
    /// Everything that is seen in mirrors and through glass
    Specular,
    /// Light that came from lamps through glass or over mirrors to the surface that is seen
    Caustic,
    /// Light that other surfaces scattered onto the surface that is seen
    Indirect,
});
value_enum!(EffectArg => Effect {
    Direct, Indirect, Glossy, ReflectiveCaustics, RefractiveCaustics, SpecularChains, Textures, Environment, MeshLights,
    PointLights, SpotLights, DirectionalLights, DiscLights, Bvh, TwoSided, SmoothNormals,
});

/// Most rounds of a run with a stop criterion other than --total-photons.
const MOST_ROUNDS: u32 = 65_536;

/// Most rounds of a run with a stop criterion, if there is one; `photons` are those of the smaller map per round.
fn most_rounds(stop: &Stop, photons: u32) -> Option<u32> {
    let by_total = |total: u64| total.div_ceil(u64::from(photons.max(1))).clamp(1, u64::from(MAX_ROUNDS)) as u32;
    stop.is_set().then(|| stop.photons.map_or(MOST_ROUNDS, by_total))
}

impl SceneArgs {
    /// The scene; prints its warnings.
    pub(super) fn open(&self, reporter: &ProgressReporter) -> Result<Scene> {
        let mut scene = Scene::open_with(&self.scene, self.radiometric, &mut stages(&self.scene, reporter))?;
        if let Some(radiance) = self.environment {
            scene.lights.push(Light { name: "--environment".into(), kind: LightKind::Environment { radiance: radiance.into() } });
        }
        for warning in &scene.warnings {
            complain(&format!("warning: {warning}"));
        }
        if !scene.is_lit() {
            complain("warning: this scene has no light and is dark; add a light, an emissive material, or --environment 1");
        }
        Ok(scene)
    }
}

impl TransportArgs {
    pub(super) fn settings(&self) -> SceneSettings {
        let usual = SceneSettings::default();
        let photons = self.photons.unwrap_or(usual.photons);
        let caustic_photons = self.caustic_photons.unwrap_or(photons);
        let stop = self.stop.stop();
        SceneSettings {
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
            edge_correction: self.edge_correction.map_or(usual.edge_correction, |switch| switch == SwitchArg::On),
            shadow_rays: self.shadow_rays.unwrap_or(usual.shadow_rays),
            final_gather: self.final_gather,
            aim: self.aim.map_or(usual.aim, |switch| switch == SwitchArg::On),
            illumination: self.illumination.map_or(usual.illumination, Illumination::from),
            builder: self.variant.map_or(usual.builder, BuilderArg::builder),
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
    json: Option<Destination>,
    trace: Option<Destination>,
}

impl ReportArgs {
    pub(super) fn open(&self) -> Result<Reports> {
        Ok(Reports { json: optional_file("--json", self.json.json.as_ref())?, trace: optional_file("--trace", self.trace.as_ref())? })
    }
}

impl TimedDeviceArgs {
    /// The device; a scene of triangles needs one.
    pub(super) fn open(&self, reporter: &ProgressReporter) -> Result<Gpu> {
        let gpu = Gpu::open(&self.timing.options(&self.device))?;
        reporter.device(Some(&gpu));
        Ok(gpu)
    }
}

impl Reports {
    pub(super) fn destinations(&self) -> Vec<Destination> {
        [&self.json, &self.trace].into_iter().flatten().cloned().collect()
    }

    pub(super) fn files(self, scene: &Scene, lit: &RunResult) -> Vec<(Destination, Vec<u8>)> {
        let json = self.json.map(|json| (json, scene_report::json(&scene.name, lit)));
        let trace = self.trace.map(|trace| (trace, trace_file::chrome_trace(&lit.timings, lit.device_name())));
        json.into_iter().chain(trace).collect()
    }
}

/// What a run is about.
pub(super) struct Job<'a> {
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a SceneSettings,
    pub(super) sensor: Sensor,
    pub(super) camera: Option<&'a Camera>,
    pub(super) phases: &'a [Vec<Receiver>],
    /// What results are of: pixel, texel or point.
    pub(super) point: &'static str,
}

impl<'a> Job<'a> {
    pub(super) fn picture(scene: &'a Scene, settings: &'a SceneSettings, camera: &'a Camera, (width, height): (u32, u32)) -> Job<'a> {
        Job { scene, settings, sensor: Sensor::Picture { width, height }, camera: Some(camera), phases: &[], point: "pixel" }
    }
}

/// The plan of a job, its default radii from a trial round.
pub(super) fn plan(gpu: &Gpu, job: &Job, geometry: &Geometry) -> Result<ScenePlan> {
    let view = View { geometry, camera: job.camera, phases: job.phases };
    let plan = scene::trial::plan(gpu, job.scene, &view, job.settings, job.sensor)?;
    if let Some(warning) = scene_report::radius_warning(&plan, geometry, job.point) {
        complain(&format!("warning: {warning}"));
    }
    Ok(plan)
}

/// Geometry of a scene without the effects that are left out.
pub(super) fn geometry(scene: &Scene, settings: &SceneSettings, reporter: &ProgressReporter) -> Result<Geometry> {
    let what = format!("{} ({})", scene.name, counted(scene.triangle_count(), "triangle"));
    let geometry = Geometry::new_with(&scene.without(&settings.without), &mut stages(&what, reporter))?;
    if geometry.left_out > 0 {
        let count = counted(geometry.left_out, "triangle");
        complain(&format!("warning: {count} without area in single precision, or on others, left out"));
    }
    geometry.overlap_warnings(scene).iter().for_each(|line| complain(&format!("warning: {line}")));
    Ok(geometry)
}

/// Reports the stages of loading `what`, each at its start and at every tenth of it.
fn stages<'a>(what: &'a str, reporter: &'a ProgressReporter) -> impl FnMut(&'static str, f64) + 'a {
    let mut reported = None;
    move |stage, done| {
        let step = (stage, (10.0 * done) as u32);
        if reported.replace(step) != Some(step) {
            reporter.status(&format!("{what}: {stage}, {} %", 10 * step.1));
        }
    }
}

/// What will be traced, before it is.
fn announce(job: &Job, geometry: &Geometry, plan: &ScenePlan, reporter: &ProgressReporter) {
    let what = match plan.sensor {
        Sensor::Picture { width, height } => format!("{width} x {height} pixels"),
        Sensor::Receivers { count } => counted(count, job.point),
    };
    let maps: Vec<String> = plan.maps().map(|map| counted(map.photons, &format!("{} photon", map.name))).collect();
    let radii: Vec<String> = plan.maps().map(|map| format!("{:.4} m ({})", map.radius * geometry.unit, map.name)).collect();
    let rounds = counted(plan.settings.rounds, "round");
    let up_to = if plan.settings.stop.is_set() { "up to " } else { "" };
    let (maps, radius) = if maps.is_empty() {
        ("no photons".to_owned(), String::new())
    } else {
        (maps.join(" and "), format!("; first radius {}", radii.join(", ")))
    };
    reporter.note(&format!(
        "plan: {}, {what}; {up_to}{rounds} of {maps}{radius}; {:.1} MiB on the device{}",
        job.scene.name,
        plan.bytes as f64 / f64::from(1 << 20),
        goals(&plan.settings.stop)
    ));
}

/// Runs all rounds and reports progress; with `bias`, measures that too.
pub(super) fn light(
    gpu: &Gpu,
    job: &Job,
    geometry: &Geometry,
    mut plan: ScenePlan,
    bias: bool,
    reporter: &ProgressReporter,
    cancelled: &AtomicBool,
) -> Result<RunResult> {
    announce(job, geometry, &plan, reporter);
    let view = View { geometry, camera: job.camera, phases: job.phases };
    let of_first = |plan: &ScenePlan, factor_and_rounds| {
        interruptible(|| scene::bias::measure(gpu, job.scene, &view, plan, factor_and_rounds, cancelled))
    };
    let alpha = plan.settings.alpha;
    let stop = plan.settings.stop;
    // The error asked for is noise and bias together, so the bias must be known beforehand.
    let before = match stop.error.filter(|_| bias) {
        Some(wanted) => bias_before(wanted, (alpha < 1.0, stop.seconds.is_some() || stop.photons.is_some()), reporter, |rounds| {
            of_first(&plan, (1.0, rounds))
        })?,
        None => None,
    };
    plan.settings.stop.bias = before.map(|bias| bias.upper);

    reporter.status("making the pipelines");
    let mut report = |progress: &Progress| reporter.report(progress, "round");
    let mut control = Control { cancelled, progress: &mut report };
    let mut lit = interruptible(|| scene::light(gpu, &view, plan, &mut control))?;
    if lit.is_cancelled() {
        complain(&format!("ended early: the results are of {} of {}", counted(lit.film.rounds, "round"), lit.plan.settings.rounds));
        return Ok(lit);
    }
    let shrunk = mean_squared_radius(alpha, lit.film.rounds);
    lit.bias = match before {
        Some(bias) => Some(bias.scaled(shrunk)),
        // At the radius whose square is the mean of the rounds' squares.
        None if bias => {
            reporter.status("measuring the bias");
            of_first(&lit.plan, (shrunk.sqrt(), rounds_after(lit.film.rounds)))?
        }
        None => None,
    };
    reporter.status("writing the results");
    Ok(lit)
}

/// The camera by name, else the scene's first, else one that sees all of it.
pub(super) fn camera(scene: &Scene, name: Option<&str>) -> Result<Camera> {
    match name {
        Some(name) => scene.cameras.iter().find(|camera| camera.name == name).cloned().ok_or_else(|| {
            let names: Vec<&str> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
            let there = if names.is_empty() {
                "no such camera: the scene has none; leave --camera out".to_owned()
            } else {
                format!("must be one of {}", names.join(", "))
            };
            Error::setting("--camera", name, there)
        }),
        None => Ok(scene.first_camera()),
    }
}
