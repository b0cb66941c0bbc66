//! The main job: light the open box with one builder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::{Args, ValueEnum};

use super::stop::{ProgressArg, StopArgs, Teller, bias_before, rounds_after};
use super::transport::photon_name;
use super::{DeviceArgs, End, TimingArgs, complain, say};
use crate::error::{Error, Result};
use crate::film::{estimate_walls, irradiance_weights};
use crate::gpu::Gpu;
use crate::output::destination::{Destination, Folder, check_distinct, write_all};
use crate::output::image::{Format, overview};
use crate::output::lightmap::{self, Quantity};
use crate::output::{report, trace_file};
use crate::render::{self, Choice, Control, Outcome};
use crate::rng::Rng;
use crate::scene::open_box::open_box;
use crate::scene::room::RoomScene;
use crate::settings::stop::Stop;
use crate::settings::{EmissionLaw, Gather, Math, PhongDirection, Preset, Settings, Sums, Variant, WALL_NAMES};
use crate::timings::{Clock, Span};
use crate::transport::replay::PhotonName;

#[derive(Args)]
pub(super) struct RunArgs {
    /// Experiment of the paper whose settings are the defaults [default: modified]
    #[arg(long, value_enum, help_heading = "Experiment")]
    preset: Option<PresetArg>,
    /// How the photon map is built [default: atomic; naive with --preset naive]
    #[arg(long, value_enum, help_heading = "Experiment")]
    variant: Option<VariantArg>,
    /// Photons of a round, all lights together [default: 5000]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Experiment")]
    photons: Option<u32>,
    /// Rounds whose photons add up [default: 1; 100 with --preset rounds; with --error, --time or --total-photons as
    /// many as it takes, 16777216 at most]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Experiment")]
    rounds: Option<u32>,
    /// Most bounces of a photon [default: 15; 2 with --preset naive]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Experiment")]
    bounces: Option<u32>,
    /// Seed of the random numbers [default: 1]
    #[arg(long, value_parser = whole::<u64>, allow_negative_numbers = true, help_heading = "Experiment")]
    seed: Option<u64>,
    /// Random numbers: the paper's drand48, its alternative the Mersenne Twister, counter-based, or
    /// Owen-scrambled Sobol' points, which fall more evenly than chance
    /// [default: rand48 with the paper's 5000 photons a round, philox with any other number]
    #[arg(long, value_enum, help_heading = "Experiment")]
    rng: Option<RngArg>,

    /// Radius of the density estimate, metres [default: 0.05; 0.025 with --preset rounds]
    #[arg(long, value_parser = number::<f64>, allow_negative_numbers = true, help_heading = "Estimate")]
    radius: Option<f64>,
    /// Photons within the radius, a round, that count as full illumination [default: 90 for every
    /// 5000 photons of a round; 10 for every 5000 with --preset rounds]
    #[arg(long, value_parser = number::<f64>, allow_negative_numbers = true, help_heading = "Estimate")]
    full_light: Option<f64>,
    /// How photons near a point are found: step through all, look into a sorted grid (the CPU builder
    /// hands photons to the grid of texels), or walk down a kd-tree; the result is the same to the bit
    /// [default: grid]
    #[arg(long, value_enum, help_heading = "Estimate")]
    gather: Option<GatherArg>,
    /// Estimate with the K photons nearest to a point, 2 to 1024 of each round, none farther than the
    /// radius; needs --gather kdtree [default: all within the radius]
    #[arg(long, value_name = "K", value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Estimate")]
    nearest: Option<u32>,
    /// Arithmetic: as fast as the device has it, or the same bits on the CPU and on every device that rounds to nearest
    /// [default: fast]
    #[arg(long, value_enum, help_heading = "Estimate")]
    math: Option<MathArg>,
    /// How the film adds: 64-bit integers, 32-bit floats, or pairs of floats that keep what rounding
    /// loses; only integers give the same bits in whatever order photons come [default: integer]
    #[arg(long, value_enum, help_heading = "Estimate")]
    sums: Option<SumsArg>,
    /// Texels along each side of a wall [default: 64]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Estimate")]
    mesh: Option<u32>,
    /// Divide irradiance and radiosity by the part of the disc that lies on the wall; the paper's
    /// illumination stays as it is [default: on]
    #[arg(long, value_enum, help_heading = "Estimate")]
    edge_correction: Option<SwitchArg>,

    /// Directions of emission: the same intensity in all of the hemisphere, or proportional to the
    /// cosine [default: uniform]
    #[arg(long, value_enum, help_heading = "Scene")]
    emission: Option<EmissionArg>,
    /// Phong exponent of all walls, or five of them for left,right,floor,ceiling,back [default: none,
    /// Lambertian; 2 with --preset phong, 5 with --preset rounds]
    #[arg(long, value_name = "N|N,N,N,N,N", value_parser = shininess, allow_hyphen_values = true, help_heading = "Scene")]
    shininess: Option<[f32; 5]>,
    /// Direction that the Phong weight compares with the eye's: mirrored, or sampled [default: mirror]
    #[arg(long, value_enum, help_heading = "Scene")]
    phong_direction: Option<PhongDirectionArg>,
    /// Eye of the Phong weight, metres [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<f32, 3>, allow_hyphen_values = true, help_heading = "Scene")]
    eye: Option<[f32; 3]>,
    /// Share of photons that a wall reflects [default: 0.75]
    #[arg(long, value_parser = number::<f32>, allow_negative_numbers = true, help_heading = "Scene")]
    reflectance: Option<f32>,
    /// Radius of the two discs of light, metres [default: 0.05]
    #[arg(long, value_parser = number::<f64>, allow_negative_numbers = true, help_heading = "Scene")]
    light_radius: Option<f64>,
    /// Power of the floor's and the left wall's light, watts [default: 1,1]
    #[arg(long, value_name = "W,W", value_parser = numbers::<f64, 2>, allow_hyphen_values = true, help_heading = "Scene")]
    light_power: Option<[f64; 2]>,

    #[command(flatten)]
    stop: StopArgs,
    #[command(flatten)]
    device: DeviceArgs,
    /// Look for values that are infinite or no number, and say whose they are
    #[arg(long, help_heading = "Output")]
    paranoid: bool,
    /// Trace one photon of the run by itself, print where it is stored and end: round and number from 0
    #[arg(long, value_name = "ROUND:PHOTON", value_parser = photon_name, help_heading = "Output",
        conflicts_with_all = ["output", "irradiance", "radiosity", "json", "trace", "time_dispatches"])]
    replay: Option<PhotonName>,
    #[command(flatten)]
    timing: TimingArgs,
    /// Threads of --variant cpu, or `all` [default: 1, as in the paper]
    #[arg(long, value_name = "N|all", value_parser = threads, help_heading = "Device")]
    threads: Option<usize>,
    /// Invocations of a work group [default: 128]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Device")]
    group_size: Option<u32>,
    /// Counters that work groups of --variant atomic take turns at, a power of two up to 64; the result is the same to the
    /// bit [default: 1, on a GPU 8 where two million photons and more are traced at once]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Device")]
    counters: Option<u32>,
    /// Most photons traced at once; the result is the same to the bit [default: what the device holds]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, help_heading = "Device")]
    chunk: Option<u32>,

    /// Picture of the box: .png shows illumination 0 to 1, .exr keeps it unclamped
    #[arg(short, long, value_name = "FILE", default_value = "open-box.png", help_heading = "Output")]
    output: PathBuf,
    /// Write each wall's irradiance in W/m2 as <wall>.exr, its standard error as <wall>-error.exr, and layout.json, into
    /// this folder
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    irradiance: Option<PathBuf>,
    /// The same for radiosity, the reflected flux
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    radiosity: Option<PathBuf>,
    /// How far the run has come: a bar on a terminal, or lines of JSON on stderr
    #[arg(long, value_enum, default_value = "bar", help_heading = "Output")]
    progress: ProgressArg,
    /// Write settings, ledger, errors and timings as JSON
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    json: Option<PathBuf>,
    /// Write the timings as a Chrome trace, for Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    trace: Option<PathBuf>,
}

/// An enum of the settings as clap values.
macro_rules! value_enum {
    ($argument:ident => $setting:ident { $($(#[$doc:meta])* $variant:ident),* $(,)? }) => {
        #[derive(Clone, Copy, ValueEnum)]
        pub(super) enum $argument { $($(#[$doc])* $variant),* }

        impl From<$argument> for $setting {
            fn from(argument: $argument) -> $setting {
                match argument { $($argument::$variant => $setting::$variant),* }
            }
        }
    };
}

pub(super) use value_enum;

value_enum!(PresetArg => Preset { Naive, Modified, Phong, Rounds });
value_enum!(RngArg => Rng { Rand48, Mt, Philox, Sobol });
value_enum!(GatherArg => Gather { Brute, Grid, #[value(name = "kdtree")] KdTree });
value_enum!(SumsArg => Sums { Integer, F32, Compensated });
value_enum!(MathArg => Math { Fast, Strict });
value_enum!(EmissionArg => EmissionLaw { Uniform, Cosine });
value_enum!(PhongDirectionArg => PhongDirection { Mirror, Sampled });

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum VariantArg {
    /// The paper's first: a slot for every photon and bounce, empty ones included
    Naive,
    /// The paper's second: survivors only, one atomic a thread
    Atomic,
    /// Survivors only, one atomic a subgroup
    Ballot,
    /// Survivors only, one atomic a work group
    Group,
    /// Survivors only, in their order, by prefix sums
    Scan,
    /// Each photon in the registers of one thread until it ends
    Persistent,
    /// What the paper calls the CPU implementation, on one thread or --threads
    Cpu,
    /// The fastest on this device for so many photons: each traces the first of them
    Auto,
}

impl VariantArg {
    /// `None` until the device has been asked.
    fn variant(self) -> Option<Variant> {
        Some(match self {
            VariantArg::Naive => Variant::Naive,
            VariantArg::Atomic => Variant::Atomic,
            VariantArg::Ballot => Variant::Ballot,
            VariantArg::Group => Variant::Group,
            VariantArg::Scan => Variant::Scan,
            VariantArg::Persistent => Variant::Persistent,
            VariantArg::Cpu => Variant::Cpu,
            VariantArg::Auto => return None,
        })
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum SwitchArg {
    On,
    Off,
}

pub(super) fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(text: &str) -> std::result::Result<[T; N], String> {
    let parts: Vec<T> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    let wanted = format!("must be {N} numbers with commas between");
    if text.split(',').count() != N {
        return Err(wanted);
    }
    parts.try_into().map_err(|_| wanted)
}

/// A whole number, with what is allowed in words; its range is the settings' affair.
pub(super) fn whole<T: std::str::FromStr>(text: &str) -> std::result::Result<T, String> {
    text.parse().map_err(|_| format!("must be a whole number, at most {}", (1u128 << (8 * size_of::<T>())) - 1))
}

pub(super) fn number<T: std::str::FromStr>(text: &str) -> std::result::Result<T, String> {
    text.parse().map_err(|_| "must be a number".to_owned())
}

fn shininess(text: &str) -> std::result::Result<[f32; 5], String> {
    let wanted = || format!("must be one number, or five for {}", WALL_NAMES.join(","));
    match numbers::<f32, 1>(text) {
        Ok([all]) => Ok([all; 5]),
        Err(_) => numbers::<f32, 5>(text).map_err(|_| wanted()),
    }
}

pub(super) fn threads(text: &str) -> std::result::Result<usize, String> {
    if text == "all" {
        return Ok(std::thread::available_parallelism().map_or(1, usize::from));
    }
    text.parse().map_err(|_| "must be a number of threads, or all".to_owned())
}

impl RunArgs {
    pub(super) fn settings(&self) -> Settings {
        let preset = Settings::preset(self.preset.map_or(Preset::Modified, Preset::from));
        let photons = self.photons.unwrap_or(preset.photons);
        let settings = Settings {
            variant: self.variant.and_then(VariantArg::variant).unwrap_or(preset.variant),
            photons,
            rounds: self.rounds.unwrap_or(preset.rounds),
            bounces: self.bounces.unwrap_or(preset.bounces),
            radius: self.radius.unwrap_or(preset.radius),
            full_light: self.full_light.unwrap_or_else(|| preset.full_light_for(photons)),
            seed: self.seed.unwrap_or(preset.seed),
            rng: self.rng.map_or(if photons == preset.photons { preset.rng } else { Rng::Philox }, Rng::from),
            gather: self.gather.map_or(preset.gather, Gather::from),
            sums: self.sums.map_or(preset.sums, Sums::from),
            nearest: self.nearest.or(preset.nearest),
            math: self.math.map_or(preset.math, Math::from),
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
            paranoid: self.paranoid,
            group_size: self.group_size.unwrap_or(preset.group_size),
            counters: self.counters.or(preset.counters),
            chunk: self.chunk.or(preset.chunk),
            stop: self.stop.stop(),
        };
        match self.rounds {
            None if settings.stop.is_set() => Settings { rounds: settings.most_rounds(), ..settings },
            _ => settings,
        }
    }
}

pub(super) fn run(args: &RunArgs, cancelled: &AtomicBool) -> Result<End> {
    let settings = args.settings();
    settings.validate()?;
    if settings.reflectance == 0.0 && args.irradiance.is_some() {
        return Err(Error::setting(
            "--reflectance",
            0,
            "must be above 0 with --irradiance, as the photon map holds reflected photons only",
        ));
    }
    if let (Variant::Cpu, Some(device)) = (settings.variant, &args.device.device) {
        return Err(Error::setting("--device", device, "has no use with --variant cpu; leave one of the two out"));
    }
    if settings.variant == Variant::Cpu && args.device.validate {
        return Err(Error::setting("--validate", "on", "has no use with --variant cpu; leave one of the two out"));
    }
    let scene = open_box(&settings);
    if let Some(name) = args.replay {
        return show_photon(args, &settings, &scene, name);
    }
    let outputs = Outputs::open(args, &scene)?;
    if let Some(warning) = settings.warning() {
        complain(&format!("warning: {warning}"));
    }
    let gpu = match settings.variant {
        Variant::Cpu => None,
        _ => args.device.open(&args.timing.options(&args.device))?,
    };
    let settings = match &gpu {
        Some(gpu) if args.variant == Some(VariantArg::Auto) => Settings { variant: fastest(gpu, &scene, &settings)?, ..settings },
        _ => settings,
    };
    if let (Some(nearest), true) = (settings.nearest, args.stop.bias) {
        let why = "takes radii of its own, whose bias no other radius tells; leave --bias out";
        return Err(Error::setting("--nearest", nearest, why));
    }
    let measure = |settings: &Settings, rounds| render::measure_bias(gpu.as_ref(), &scene, settings, rounds, cancelled);
    let before = match settings.stop.error.filter(|_| args.stop.bias) {
        Some(wanted) => bias_before(wanted, false, |rounds| measure(&settings, rounds))?,
        None => None,
    };
    let settings = Settings { stop: Stop { bias: before.map(|bias| bias.upper), ..settings.stop }, ..settings };
    let teller = Teller::new(args.progress, "photons");
    let mut control = Control { cancelled, progress: &mut |progress| teller.tell(progress) };
    let mut outcome = match &gpu {
        Some(gpu) => render::on_gpu(gpu, &scene, &settings, &mut control)?,
        None => render::on_cpu(&scene, &settings, &mut control)?,
    };
    teller.finish();
    outcome.bias = before;
    if before.is_none() && args.stop.bias && !outcome.cancelled {
        outcome.bias = measure(&settings, rounds_after(outcome.film.rounds))?;
    }
    let end = if outcome.cancelled { End::Cancelled } else { End::Finished };
    if outcome.cancelled {
        let (emitted, total) = (outcome.fates.emitted, settings.total_photons());
        complain(&format!("ended after {emitted} of {total} photons; what is written is of these"));
    }
    outputs.write(outcome, &scene)?;
    Ok(end)
}

/// The builder that is fastest on this device, told with what each of them took.
fn fastest(gpu: &Gpu, scene: &RoomScene, settings: &Settings) -> Result<Variant> {
    let Choice { photons, candidates } = render::choose_variant(gpu, scene, settings)?;
    let times: Vec<String> =
        candidates.iter().map(|candidate| format!("{} {:.3}", candidate.variant.name(), candidate.ms.median)).collect();
    let taken = candidates[0].variant;
    complain(&format!("--variant auto takes {}; the first {photons} photons, in ms: {}", taken.name(), times.join(", ")));
    Ok(taken)
}

/// Where one photon of the run is stored.
fn show_photon(args: &RunArgs, settings: &Settings, scene: &RoomScene, name: PhotonName) -> Result<End> {
    let PhotonName { round, photon, caustic } = name;
    if caustic {
        return Err(Error::setting("--replay", name, "the paper's box has one map; leave :caustic out"));
    }
    let gpu = if settings.variant == Variant::Cpu { None } else { args.device.open(&args.device.options())? };
    let path = match &gpu {
        Some(gpu) => render::replay_on_gpu(gpu, scene, settings, round, photon)?,
        None => render::replay_on_cpu(scene, settings, round, photon)?,
    };
    let name_of = |wall: u32| scene.faces[wall as usize].as_ref().map_or("opening", |wall| wall.name);
    let (p, d) = (path.start.position, path.start.direction);
    say(&format!("photon {photon} of round {round}, seed {}", settings.seed))?;
    say(&format!("{:>6} {:<8} {:>10} {:>10} {:>10} {:>10}", "bounce", "wall", "x, m", "y", "z", "weight"))?;
    let start = name_of(path.start.wall);
    say(&format!("{:>6} {start:<8} {:>10.6} {:>10.6} {:>10.6}   towards {:.6}, {:.6}, {:.6}", "light", p.x, p.y, p.z, d.x, d.y, d.z))?;
    for photon in &path.stored {
        let (wall, p) = (name_of(photon.wall), photon.position);
        say(&format!("{:>6} {wall:<8} {:>10.6} {:>10.6} {:>10.6} {:>10.6}", photon.bounce + 1, p.x, p.y, p.z, photon.weight))?;
    }
    say(&format!("stored {} time(s), then it {}", path.stored.len(), path.fate))?;
    if let Some(oddities) = &path.oddities {
        say(&oddities.text())?;
    }
    Ok(End::Finished)
}

/// Everything that the run will write, checked before it starts.
struct Outputs {
    picture: (Destination, Format),
    irradiance: Option<Folder>,
    radiosity: Option<Folder>,
    json: Option<Destination>,
    trace: Option<Destination>,
}

impl Outputs {
    fn open(args: &RunArgs, scene: &RoomScene) -> Result<Outputs> {
        let file = |option, path: &Option<PathBuf>| path.as_ref().map(|path| Destination::open(option, path)).transpose();
        let folder = |option, path: &Option<PathBuf>| path.as_ref().map(|path| Folder::open(option, path)).transpose();
        let outputs = Outputs {
            picture: (Destination::open("-o", &args.output)?, Format::of("-o", &args.output)?),
            json: file("--json", &args.json)?,
            trace: file("--trace", &args.trace)?,
            irradiance: folder("--irradiance", &args.irradiance)?,
            radiosity: folder("--radiosity", &args.radiosity)?,
        };
        let folders = [&outputs.irradiance, &outputs.radiosity].into_iter().flatten();
        let mut all = vec![outputs.picture.0.clone()];
        all.extend([&outputs.json, &outputs.trace].into_iter().flatten().cloned());
        all.extend(folders.flat_map(|folder| lightmap::destinations(folder, scene)));
        check_distinct(&all)?;
        Ok(outputs)
    }

    fn write(self, mut outcome: Outcome, scene: &RoomScene) -> Result<()> {
        let began = Instant::now();
        let walls = estimate_walls(&outcome.film, scene, &outcome.plan);
        // W of a photon of relative flux 1.
        let watts = outcome.plan.flux_unit / outcome.film.emitted.max(1) as f64;
        let unknown = outcome.film.unknown(&irradiance_weights(scene, &outcome.plan), watts, outcome.plan.settings.stop.confidence);
        let (destination, format) = self.picture;
        let picture = destination.path().display().to_string();
        let mut files = vec![(destination, overview(scene, &walls).encode(format))];
        for (folder, quantity) in [(&self.irradiance, Quantity::Irradiance), (&self.radiosity, Quantity::Radiosity)] {
            files.extend(folder.iter().flat_map(|folder| lightmap::files(folder, quantity, scene, &walls)));
        }
        let run = outcome.timings.spans().iter().map(|span| span.start + span.duration).max().unwrap_or_default();
        outcome.timings.count("output");
        outcome.timings.add(Span { name: "output".into(), clock: Clock::Wall, start: run, duration: began.elapsed() });

        if let Some(json) = self.json {
            files.push((json, report::json(&outcome, &walls, &unknown)));
        }
        if let Some(trace) = self.trace {
            let device = outcome.device.as_ref().map_or("CPU", |facts| &facts.name);
            files.push((trace, trace_file::chrome_trace(&outcome.timings, device)));
        }
        write_all(files)?;
        say(&format!("{}\nwrote {picture}", report::text(&outcome, &walls, &unknown)))
    }
}
