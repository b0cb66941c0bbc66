//! The main job: light the open box with one builder.

use std::cell::OnceCell;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;

use super::how_made::of_room;
use super::keep::{KeepArgs, Keeper};
use super::options::{CommonArgs, DevicesOfRunArgs, ReportArgs, Reports};
use super::progress::{ProgressArgs, ProgressReporter};
use super::stop::{StopArgs, bias_before, goals, rounds_after, up_to};
use super::typed::Typed;
use super::values::{
    BuilderArg, SwitchArg, builder_parser, parse_integer, parse_number, parse_numbers, parse_photon_name, parse_shininess, parse_threads,
    parse_within, value_enum,
};
use super::{End, complain, device_failed, say, say_beside};
use crate::engine;
use crate::engine::Control;
use crate::engine::choose_builder::{Choice, choose_builder};
use crate::engine::error::bound::ErrorSource;
use crate::engine::replay::PhotonName;
use crate::engine::retry::{run_on, until_done};
use crate::engine::room::film::{RoomFilm, estimate_walls};
use crate::engine::room::{self, RunResult};
use crate::engine::saved::SavedFilm;
use crate::engine::several_devices::Work;
use crate::error::{Result, require};
use crate::gpu::Gpu;
use crate::ledger::Fates;
use crate::output::colour::Format;
use crate::output::destination::{Destination, Folder, check_distinct, write_all};
use crate::output::image::overview;
use crate::output::lightmap::{self, Quantity};
use crate::output::room_report;
use crate::plan::{Limits, RoomPlan};
use crate::rng::Rng;
use crate::scene::open_box::open_box;
use crate::scene::room::RoomScene;
use crate::settings::stop::Stop;
use crate::settings::{Builder, EmissionLaw, Gather, Math, PhongDirection, Preset, RoomSettings, Sums};
use crate::text::counted;
use crate::timings::Span;

#[derive(Args)]
pub(super) struct RunArgs {
    /// Picture of the box: a .png shows illumination from 0 to 1, an .exr keeps it unclamped
    #[arg(short, long, alias = "out", value_name = "FILE", default_value = "open-box.png", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    /// Write the irradiance of each wall in W/m2 as <wall>.exr, its standard error as <wall>-error.exr, and layout.json,
    /// into this folder
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    irradiance: Option<PathBuf>,
    /// The same for the radiosity, the reflected flux per area
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    radiosity: Option<PathBuf>,

    /// Angular distribution of emission: constant over the hemisphere, or proportional to the cosine [default: uniform]
    #[arg(long, value_enum, value_name = "LAW", help_heading = "Scene")]
    emission: Option<EmissionArg>,
    /// Phong exponent of all walls, or five of them for left,right,floor,ceiling,back [default: none, the walls are
    /// Lambertian; 2 with --preset phong, 5 with --preset rounds]
    #[arg(long, value_name = "N|N,N,N,N,N", value_parser = parse_shininess, allow_hyphen_values = true, help_heading = "Scene")]
    shininess: Option<[f32; 5]>,
    /// Direction that the Phong weight compares with the direction to the eye: the mirror direction, or the sampled one
    /// [default: mirror]
    #[arg(long, value_enum, value_name = "DIRECTION", help_heading = "Scene")]
    phong_direction: Option<PhongDirectionArg>,
    /// Position of the eye for the Phong weight, metres [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_numbers::<f32, 3>, allow_hyphen_values = true, help_heading = "Scene")]
    eye: Option<[f32; 3]>,
    /// Probability that a wall reflects a photon [default: 0.75]
    #[arg(long, value_name = "SHARE", value_parser = parse_number::<f32>, allow_hyphen_values = true, help_heading = "Scene")]
    reflectance: Option<f32>,
    /// Radius of the two disc lights, metres [default: 0.05]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    light_radius: Option<f64>,
    /// Power of the light on the floor and of the light on the left wall, watts [default: 1,1]
    #[arg(long, value_name = "W,W", value_parser = parse_numbers::<f64, 2>, allow_hyphen_values = true, help_heading = "Scene")]
    light_power: Option<[f64; 2]>,

    #[command(flatten)]
    stop: StopArgs,
    #[command(flatten)]
    keep: KeepArgs,

    /// Experiment of the paper that sets the defaults [default: modified]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Photons")]
    preset: Option<PresetArg>,
    /// Photons per round, summed over all lights [default: 5000]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    photons: Option<u32>,
    /// Number of rounds, whose photons are summed [default: 1; 100 with --preset rounds; as many as needed with --error,
    /// --time or --total-photons, 1048576 at most]
    #[arg(long, value_name = "N", value_parser = parse_within(1..=u32::MAX), allow_hyphen_values = true, help_heading = "Photons")]
    rounds: Option<u32>,
    /// Maximum number of bounces of a photon [default: 15; 2 with --preset naive]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    bounces: Option<u32>,
    /// Random number generator [default: rand48 with the paper's 5000 photons per round, otherwise philox]
    #[arg(long, value_enum, value_name = "GENERATOR", help_heading = "Photons")]
    rng: Option<RngArg>,

    /// Radius of the density estimate, metres [default: 0.05; 0.025 with --preset rounds]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Density estimate")]
    radius: Option<f64>,
    /// Photons within the radius, per round, that are shown as full illumination [default: 90 per 5000 photons of a
    /// round; 10 per 5000 with --preset rounds]
    #[arg(long, value_name = "N", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Density estimate")]
    full_light: Option<f64>,
    /// Use only the K nearest photons of each round, 2 to 1024, none farther away than the radius; needs --gather kdtree
    /// [default: all within the radius]
    #[arg(long, value_name = "K", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Density estimate")]
    nearest: Option<u32>,
    /// Divide by the part of the search disc that lies on the wall, not by the whole disc, for irradiance and radiosity; the paper's
    /// illumination stays uncorrected [default: on]
    #[arg(long, value_enum, value_name = "SWITCH", help_heading = "Density estimate")]
    edge_correction: Option<SwitchArg>,
    /// Texels along each side of a wall [default: 64]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Density estimate")]
    mesh: Option<u32>,
    /// Builder of the photon map; all GPU builders give bit-identical results [default: atomic; naive with --preset naive]
    #[arg(long, value_name = "BUILDER", help_heading = "Implementation",
        value_parser = builder_parser(Builder::ALL, "The fastest on this device: each builder is timed on the first photons"))]
    variant: Option<BuilderArg>,
    /// How photons near a point are found; all give bit-identical results [default: grid]
    #[arg(long, value_enum, value_name = "SEARCH", help_heading = "Implementation")]
    gather: Option<GatherArg>,
    /// Number format of the film's sums [default: integer]
    #[arg(long, value_enum, value_name = "NUMBERS", help_heading = "Implementation")]
    sums: Option<SumsArg>,
    /// Counters of --variant atomic, a power of two up to 64, which work groups use round-robin; the result is
    /// the same to the bit [default: 1; on a GPU 8 from two million photons at once]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Implementation")]
    counters: Option<u32>,
    /// Threads of --variant cpu, or `all` [default: 1, as in the paper]
    #[arg(long, value_name = "N|all", value_parser = parse_threads, allow_hyphen_values = true, help_heading = "Implementation")]
    threads: Option<usize>,

    #[command(flatten)]
    common: CommonArgs,
    /// Trace a single photon of this run, print where it is stored, and exit; rounds and photons count from 0
    #[arg(long, value_name = "ROUND:PHOTON", value_parser = parse_photon_name, help_heading = "Checks",
        conflicts_with_all = ["output", "irradiance", "radiosity", "json", "trace", "time_dispatches", "devices"])]
    replay: Option<PhotonName>,

    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

value_enum!(PresetArg => Preset {
    /// Figure 1: the naive implementation, 2 bounces
    Naive,
    /// Figure 2: the modified implementation, 15 bounces
    Modified,
    /// Figure 3: the same with Phong walls of exponent 2
    Phong,
    /// Figure 4: 100 rounds, radius 0.025 m, Phong exponent 5
    Rounds,
});
value_enum!(RngArg => Rng {
    /// The paper's drand48, leap-frogged
    Rand48,
    /// The paper's alternative, the Mersenne Twister
    Mt,
    /// Counter-based
    Philox,
    /// Owen-scrambled Sobol' points (quasi-Monte Carlo)
    Sobol,
});
value_enum!(GatherArg => Gather {
    /// Test every photon, as in the paper
    Brute,
    /// A sorted uniform grid; the CPU builder splats photons onto texels instead
    Grid,
    /// A kd-tree
    #[value(name = "kdtree")]
    KdTree,
});
value_enum!(SumsArg => Sums {
    /// 64-bit fixed point: the same bits in any order of addition
    Integer,
    /// 32-bit floats
    F32,
    /// Pairs of 32-bit floats (compensated summation)
    Compensated,
});
value_enum!(EmissionArg => EmissionLaw { Uniform, Cosine });
value_enum!(PhongDirectionArg => PhongDirection { Mirror, Sampled });

impl RunArgs {
    /// Where the picture goes, how it is watched, and what makes it.
    pub(super) fn set(&mut self, output: PathBuf, progress: ProgressArgs, device: DevicesOfRunArgs) {
        (self.output, self.progress, self.device) = (output, progress, device);
    }

    pub(super) fn settings(&self) -> RoomSettings {
        let preset = RoomSettings::preset(self.preset.map_or(Preset::Modified, Preset::from));
        let photons = self.photons.unwrap_or(preset.photons);
        let CommonArgs { seed, math, chunk, group_size, paranoid } = self.common;
        let settings = RoomSettings {
            builder: self.variant.flatten().unwrap_or(preset.builder),
            photons,
            rounds: self.rounds.unwrap_or(preset.rounds),
            bounces: self.bounces.unwrap_or(preset.bounces),
            radius: self.radius.unwrap_or(preset.radius),
            full_light: self.full_light.unwrap_or_else(|| preset.full_light_for(photons)),
            seed: seed.unwrap_or(preset.seed),
            rng: self.rng.map_or(if photons == preset.photons { preset.rng } else { Rng::Philox }, Rng::from),
            gather: self.gather.map_or(preset.gather, Gather::from),
            sums: self.sums.map_or(preset.sums, Sums::from),
            nearest: self.nearest.or(preset.nearest),
            math: math.map_or(preset.math, Math::from),
            emission: self.emission.map_or(preset.emission, EmissionLaw::from),
            shininess: self.shininess.map_or(preset.shininess, |all| all.map(Some)),
            phong_direction: self.phong_direction.map_or(preset.phong_direction, PhongDirection::from),
            eye: self.eye.unwrap_or(preset.eye),
            light_radius: self.light_radius.unwrap_or(preset.light_radius),
            light_power: self.light_power.unwrap_or(preset.light_power),
            reflectance: self.reflectance.unwrap_or(preset.reflectance),
            mesh: self.mesh.unwrap_or(preset.mesh),
            edge_correction: self.edge_correction.map_or(preset.edge_correction, |switch| switch == SwitchArg::On),
            threads: self.threads.unwrap_or(preset.threads),
            paranoid,
            group_size: group_size.unwrap_or(preset.group_size),
            counters: self.counters.or(preset.counters),
            chunk,
            stop: self.stop.stop(),
        };
        match self.rounds {
            None if settings.stop.is_set() => RoomSettings { rounds: settings.most_rounds(), ..settings },
            _ => settings,
        }
    }
}

pub(super) fn run(args: &RunArgs, typed: &Typed, cancelled: &AtomicBool) -> Result<End> {
    let settings = args.settings();
    settings.validate()?;
    let stores_none = settings.reflectance == 0.0 && args.irradiance.is_some();
    require(!stores_none, "--reflectance", 0, "must be above 0 with --irradiance: the photon map holds only reflected photons")?;
    if settings.builder == Builder::Cpu {
        args.device.check_unused("has no effect with --variant cpu; leave one of the two out")?;
    }
    let scene = open_box(&settings);
    if let Some(name) = args.replay {
        return show_photon(args, &settings, &scene, name);
    }
    let mut keeper = args.keep.open(&args.stop)?;
    let outputs = Outputs::open(args, &scene, &keeper)?;
    if let Some(warning) = settings.warning() {
        complain(&format!("warning: {warning}"));
    }
    let reporter = ProgressReporter::new(&args.progress);
    let mut gpus = if settings.builder == Builder::Cpu { Vec::new() } else { args.device.open_or_none(&reporter)? };
    if gpus.is_empty() {
        reporter.device(None);
    }
    let gpu = gpus.first();
    let settings = match gpu {
        Some(gpu) if args.variant == Some(None) => RoomSettings { builder: fastest(gpu, &scene, &settings, &reporter)?, ..settings },
        None => RoomSettings { builder: Builder::Cpu, ..settings },
        _ => settings,
    };
    if let Some(nearest) = settings.nearest {
        let why = "has a radius of its own at each point, whose bias --bias cannot measure; leave --bias out";
        require(!args.stop.bias, "--nearest", nearest, why)?;
    }
    announce(&reporter, gpu, &scene, &settings)?;
    let measure = |gpu: Option<&mut Gpu>, settings: &RoomSettings, rounds| match gpu {
        Some(gpu) => until_done(gpu, &device_failed, |gpu| room::measure_bias(Some(gpu), &scene, settings, rounds, cancelled)),
        None => room::measure_bias(None, &scene, settings, rounds, cancelled),
    };
    let before = bias_before(&settings.stop, args.stop.bias, false, &reporter, |rounds| measure(gpus.first_mut(), &settings, rounds))?;
    let settings = RoomSettings { stop: Stop { bias: before.map(|bias| bias.upper), ..settings.stop }, ..settings };
    reporter.status("making the pipelines");
    let keep = keeper.keep("open-box");
    let mut control = Control { cancelled, progress: &mut |progress| reporter.report(progress, "photon"), keep };
    let mut outcome = match gpus.len() {
        0 => room::run(None, &scene, &settings, &mut control)?,
        _ => light(&mut gpus, &scene, &settings, &mut control)?,
    };
    outcome.bias = before;
    if before.is_none() && args.stop.bias && !outcome.is_cancelled() {
        reporter.status("measuring the bias");
        outcome.bias = measure(gpus.first_mut(), &settings, rounds_after(outcome.film.rounds))?;
    }
    reporter.finish();
    let end = End::of(&outcome);
    if outcome.is_cancelled() {
        let (emitted, total) = (outcome.film.emitted, settings.total_photons());
        complain(&format!("ended after {emitted} of {total} photons; the results are of these"));
    }
    outputs.write(outcome, &scene, typed)?;
    keeper.finish()?;
    Ok(end)
}

/// Runs on all devices.
fn light(gpus: &mut Vec<Gpu>, scene: &RoomScene, settings: &RoomSettings, control: &mut Control) -> Result<RunResult> {
    let is_alone = gpus.len() == 1;
    require(is_alone || settings.sums == Sums::Integer, "--devices", "with --sums", "adds up integers only; leave --sums out")?;
    let plan = RoomPlan::new(scene, settings, &engine::limits(gpus[0].facts()))?;
    let weights = OnceCell::new();
    let run =
        |gpu: &Gpu, stop: Stop, control: &mut Control| room::run(Some(gpu), scene, &RoomSettings { stop, ..settings.clone() }, control);
    let work = Work {
        run: &run,
        film: |film| match film {
            SavedFilm::Room(film) => film,
            SavedFilm::Scene(_) => unreachable!("the box was lit"),
        },
        error: &|film: &RoomFilm| room::error(film, scene, &plan, &weights),
        losses: &|_: &RoomFilm, fates: &[Fates]| room::losses(&plan, fates),
        can_go_on: settings.sums == Sums::Integer,
        stop: settings.stop,
        // The paper's radius never shrinks, and its rounds are independent.
        alpha: 1.0,
        rounds: settings.rounds,
        rounds_per_block: 1,
        bounces: settings.bounces,
        photons_per_round: settings.photons.into(),
    };
    let outcome = run_on(gpus, &work, &device_failed, control)?;
    // With its goals, which no device had.
    Ok(RunResult { plan: RoomPlan { settings: settings.clone(), ..outcome.plan }, ..outcome })
}

/// What will be traced, before it is.
fn announce(reporter: &ProgressReporter, gpu: Option<&Gpu>, scene: &RoomScene, settings: &RoomSettings) -> Result<()> {
    let memory = match gpu {
        Some(gpu) => {
            let plan = RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))?;
            format!("{:.1} MiB on the device", plan.bytes() as f64 / f64::from(1 << 20))
        }
        None => {
            let plan = RoomPlan::new(scene, settings, &Limits::of_host())?;
            format!("{:.1} MiB for the photon map", plan.photon_map_bytes() as f64 / f64::from(1 << 20))
        }
    };
    let RoomSettings { builder, rounds, photons, bounces, radius, mesh, .. } = settings;
    reporter.note(&format!(
        "plan: open box, {} builder, {} of {photons} photons, {}; radius {radius} m; {mesh} x {mesh} texels per wall; {memory}{}",
        builder.name(),
        up_to(&settings.stop, *rounds),
        counted(bounces, "bounce"),
        goals(&settings.stop)
    ));
    Ok(())
}

/// The builder that is fastest on this device; prints the time of each.
fn fastest(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, reporter: &ProgressReporter) -> Result<Builder> {
    reporter.status("timing each builder");
    let Choice { photons, candidates } = choose_builder(gpu, scene, settings)?;
    let times: Vec<String> =
        candidates.iter().map(|candidate| format!("{} {:.3}", candidate.builder.name(), candidate.ms.median)).collect();
    let taken = candidates[0].builder;
    reporter.note(&format!("--variant auto takes {}; the first {photons} photons, in ms: {}", taken.name(), times.join(", ")));
    Ok(taken)
}

/// Where one photon of the run is stored.
fn show_photon(args: &RunArgs, settings: &RoomSettings, scene: &RoomScene, name: PhotonName) -> Result<End> {
    let gpu = if settings.builder == Builder::Cpu { None } else { args.device.one.chosen.open(&args.device.one.chosen.options())? };
    say(&room::replay(gpu.as_ref(), scene, settings, name)?.table(scene, settings.seed))?;
    Ok(End::Finished)
}

/// Everything that the run will write, checked before it starts.
struct Outputs {
    picture: (Destination, Format),
    irradiance: Option<Folder>,
    radiosity: Option<Folder>,
    reports: Reports,
}

impl Outputs {
    fn open(args: &RunArgs, scene: &RoomScene, keeper: &Keeper) -> Result<Outputs> {
        let folder = |option, path: &Option<PathBuf>| path.as_ref().map(|path| Folder::open(option, path)).transpose();
        let outputs = Outputs {
            picture: (Destination::open("-o", &args.output)?, Format::of("-o", &args.output)?),
            reports: args.report.open()?,
            irradiance: folder("--irradiance", &args.irradiance)?,
            radiosity: folder("--radiosity", &args.radiosity)?,
        };
        let folders = [&outputs.irradiance, &outputs.radiosity].into_iter().flatten();
        let mut all = vec![outputs.picture.0.clone()];
        all.extend(outputs.reports.destinations());
        all.extend(keeper.destinations());
        all.extend(folders.flat_map(|folder| lightmap::destinations(folder, scene)));
        check_distinct(&all)?;
        Ok(outputs)
    }

    fn write(self, mut outcome: RunResult, scene: &RoomScene, typed: &Typed) -> Result<()> {
        let began = Instant::now();
        let walls = estimate_walls(&outcome.film, scene, &outcome.plan);
        let error = room_report::error(&outcome, scene);
        let (destination, format) = self.picture;
        let picture = destination.path().display().to_string();
        let mut files = vec![(destination, overview(scene, &walls).encode(format, Some(&of_room(typed, &outcome, &error, format))))];
        let confidence = outcome.plan.settings.stop.confidence;
        let source = ErrorSource { degrees_of_freedom: outcome.film.error_freedom(), confidence };
        for (folder, quantity) in [(&self.irradiance, Quantity::Irradiance), (&self.radiosity, Quantity::Radiosity)] {
            files.extend(folder.iter().flat_map(|folder| lightmap::files(folder, quantity, scene, &walls, source)));
        }
        let run = outcome.timings.spans().iter().map(|span| span.start + span.duration).max().unwrap_or_default();
        outcome.timings.count("output");
        outcome.timings.add(Span::of_host("output", run, began.elapsed()));

        files.extend(self.reports.files(&outcome, || room_report::json(&outcome, &walls, &error)));
        let destinations: Vec<Destination> = files.iter().map(|(destination, _)| destination.clone()).collect();
        let text = room_report::text(&outcome, &error);
        match write_all(files) {
            Ok(()) => say_beside(&destinations, &format!("{text}\nwrote {picture}")),
            Err(error) => say_beside(&destinations, &text).and(Err(error)),
        }
    }
}
