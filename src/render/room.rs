//! The paper's box: from a request to a run.

use std::path::Path;

use super::bias::{bias_before, rounds_after};
use super::checkpoints::Checkpoints;
use super::events::{Event, Observer};
use super::image::{command_line, kept, name_in_text};
use super::request::RenderRequest;
use super::values::{Shininess, Threads, Variant, Watts};
use crate::engine::choose_builder::{Choice, choose_builder};
use crate::engine::error::bound::FilmError;
use crate::engine::room::film::estimate_walls;
use crate::engine::room::{self, RunResult};
use crate::engine::run::identity::settings_with_effect;
use crate::engine::run::retry::{run_on, until_done};
use crate::engine::run::watch::End;
use crate::engine::{self, Control};
use crate::error::{Result, require};
use crate::gpu::Gpu;
use crate::output::colour::Format;
use crate::output::destination::{Destination, write_all};
use crate::output::image::overview;
use crate::output::metadata::{Metadata, Repeat, devices, errors};
use crate::output::report::{goals, up_to};
use crate::output::room_report;
use crate::plan::work_division::Division;
use crate::plan::{Limits, RoomPlan};
use crate::rng::Rng;
use crate::scene::open_box::open_box;
use crate::scene::room::RoomScene;
use crate::settings::scene::SceneSettings;
use crate::settings::stop::Stop;
use crate::settings::{Builder, Preset, RoomSettings, Sums};
use crate::text::counted;

impl RenderRequest {
    /// Settings of the paper's box: those of its experiment, but for what is asked for.
    pub fn room_settings(&self) -> RoomSettings {
        let preset = RoomSettings::preset(self.preset.unwrap_or(Preset::Modified));
        let photons = self.photons.unwrap_or(preset.photons);
        let settings = RoomSettings {
            builder: self.variant.and_then(Variant::builder).unwrap_or(preset.builder),
            photons,
            rounds: self.rounds.unwrap_or(preset.rounds),
            bounces: self.bounces.unwrap_or(preset.bounces),
            radius: self.radius.unwrap_or(preset.radius),
            full_light: self.full_light.unwrap_or_else(|| preset.full_light_for(photons)),
            seed: self.seed.unwrap_or(preset.seed),
            // Rand48 is dealt out by leap-frogging, which a count with a large power of two makes almost regular.
            rng: self.rng.unwrap_or(if photons == preset.photons { preset.rng } else { Rng::Philox }),
            gather: self.gather.unwrap_or(preset.gather),
            sums: self.sums.unwrap_or(preset.sums),
            nearest: self.nearest.or(preset.nearest),
            math: self.math.unwrap_or(preset.math),
            emission: self.emission.unwrap_or(preset.emission),
            shininess: self.shininess.map_or(preset.shininess, |Shininess(all)| all.map(Some)),
            phong_direction: self.phong_direction.unwrap_or(preset.phong_direction),
            eye: self.eye.map_or(preset.eye, |eye| eye.as_vec3().to_array()),
            light_radius: self.light_radius.unwrap_or(preset.light_radius),
            light_power: self.light_power.map_or(preset.light_power, |Watts(watts)| watts),
            reflectance: self.reflectance.unwrap_or(preset.reflectance),
            mesh: self.mesh.unwrap_or(preset.mesh),
            edge_correction: self.edge_correction.unwrap_or(preset.edge_correction),
            threads: self.threads.map_or(preset.threads, |Threads(threads)| threads),
            paranoid: self.paranoid,
            group_size: self.group_size.unwrap_or(preset.group_size),
            counters: self.counters.or(preset.counters),
            chunk: self.chunk,
            stop: self.stop(),
        };
        match self.rounds {
            None if settings.stop.is_set() => RoomSettings { rounds: settings.most_rounds(), ..settings },
            _ => settings,
        }
    }
}

/// The box of a request.
pub(crate) struct PreparedRoom<'a> {
    pub request: &'a RenderRequest,
    pub settings: RoomSettings,
    pub scene: RoomScene,
}

impl PreparedRoom<'_> {
    /// Runs to the end, on the CPU where there is no device.
    pub(crate) fn run(&self, gpus: &mut Vec<Gpu>, checkpoints: &mut Checkpoints, observer: &Observer) -> Result<RunResult> {
        let (scene, measures_bias) = (&self.scene, self.request.bias);
        let mut settings = self.settings.clone();
        match gpus.first() {
            Some(gpu) if self.request.variant == Some(Variant::Auto) => settings.builder = fastest(gpu, scene, &settings, observer)?,
            None => settings.builder = Builder::Cpu,
            _ => {}
        }
        if let Some(nearest) = settings.nearest {
            let why = "has a radius of its own at each point, whose bias `bias` cannot measure; leave `bias` out";
            require(!measures_bias, "nearest", nearest, why)?;
        }
        observer.report(Event::Note(&plan_line(gpus.first(), scene, &settings)?));
        let cancelled = observer.cancelled;
        let measure = |gpu: Option<&mut Gpu>, settings: &RoomSettings, rounds| match gpu {
            Some(gpu) => until_done(gpu, &observer.failed(), |gpu| room::measure_bias(Some(gpu), scene, settings, rounds, cancelled)),
            None => room::measure_bias(None, scene, settings, rounds, cancelled),
        };
        let of_first_round = |rounds| measure(gpus.first_mut(), &settings, rounds);
        let before = bias_before(&settings.stop, measures_bias, false, observer, of_first_round)?;
        settings.stop.bias = before.map(|bias| bias.upper);
        observer.report(Event::Status("making the pipelines"));
        let checkpointing = checkpoints.checkpointing("open-box");
        let mut control =
            Control { cancelled, progress: &mut |progress| observer.report(Event::Progress(progress, "photon")), checkpointing };
        let mut result = match gpus.len() {
            0 => room::run(None, scene, &settings, &mut control)?,
            _ => light(gpus, scene, &settings, observer, &mut control)?,
        };
        result.bias = before;
        if before.is_none() && measures_bias && !result.is_cancelled() {
            observer.report(Event::Status("measuring the bias"));
            result.bias = measure(gpus.first_mut(), &settings, rounds_after(result.film.rounds))?;
        }
        if result.is_cancelled() {
            let (emitted, total) = (result.film.emitted, settings.total_photons());
            observer.report(Event::Remark(&format!("ended after {emitted} of {total} photons; the results are of these")));
        }
        Ok(result)
    }
}

/// Runs on all devices.
fn light(gpus: &mut Vec<Gpu>, scene: &RoomScene, settings: &RoomSettings, observer: &Observer, control: &mut Control) -> Result<RunResult> {
    let is_alone = gpus.len() == 1;
    require(is_alone || settings.sums == Sums::Integer, "devices", "with `sums`", "adds up integers only; leave `sums` out")?;
    let plan = RoomPlan::new(scene, settings, &engine::limits(gpus[0].facts()))?;
    let run =
        |gpu: &Gpu, stop: Stop, control: &mut Control| room::run(Some(gpu), scene, &RoomSettings { stop, ..settings.clone() }, control);
    let result = run_on(gpus, &room::task(scene, &plan), &run, &observer.failed(), control)?;
    // With its goals, which no device had.
    Ok(RunResult { plan: RoomPlan { settings: settings.clone(), ..result.plan }, ..result })
}

/// What will be traced, before it is.
fn plan_line(gpu: Option<&Gpu>, scene: &RoomScene, settings: &RoomSettings) -> Result<String> {
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
    Ok(format!(
        "plan: open box, {} builder, {} of {photons} photons, {}; radius {radius} m; {mesh} x {mesh} texels per wall; {memory}{}",
        builder.name(),
        up_to(&settings.stop, *rounds),
        counted(bounces, "bounce"),
        goals(&settings.stop)
    ))
}

/// The builder that is fastest on this device; reports the time of each.
fn fastest(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings, observer: &Observer) -> Result<Builder> {
    observer.report(Event::Status("timing each builder"));
    let Choice { photons, candidates } = choose_builder(gpu, scene, settings)?;
    let times: Vec<String> =
        candidates.iter().map(|candidate| format!("{} {:.3}", candidate.builder.name(), candidate.ms.median)).collect();
    let taken = candidates[0].builder;
    let (name, times) = (taken.name(), times.join(", "));
    observer.report(Event::Note(&format!("`variant` auto takes {name}; the first {photons} photons, in ms: {times}")));
    Ok(taken)
}

/// The picture of the box.
pub struct RoomImage<'a> {
    pub result: RunResult,
    scene: RoomScene,
    request: &'a RenderRequest,
}

/// Lights the box that a request asks for, on the CPU where there is no device.
pub fn render<'a>(gpus: &mut Vec<Gpu>, request: &'a RenderRequest, observer: &Observer) -> Result<RoomImage<'a>> {
    let settings = request.room_settings();
    settings.validate()?;
    let prepared = PreparedRoom { request, scene: open_box(&settings), settings };
    let mut checkpoints = Checkpoints::open(request, observer)?;
    let result = prepared.run(gpus, &mut checkpoints, observer)?;
    checkpoints.finish()?;
    Ok(RoomImage { result, scene: prepared.scene, request })
}

impl RoomImage<'_> {
    pub fn error(&self) -> FilmError {
        room_report::error(&self.result, &self.scene)
    }

    pub fn devices(&self) -> Vec<String> {
        devices_of(&self.result)
    }

    /// Writes a `.png` or an `.exr`, as the file's name ends.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let format = Format::of("output", path)?;
        write_all([(Destination::open("output", path)?, self.file(format))])
    }

    /// The content of such a file.
    pub fn file(&self, format: Format) -> Vec<u8> {
        let walls = estimate_walls(&self.result.film, &self.scene, &self.result.plan);
        let metadata = metadata(self.request, &self.result, &self.error(), format);
        overview(&self.scene, &walls).encode(format, Some(&metadata))
    }
}

/// What a picture of the box says of how it was made; its command line makes it again.
pub(crate) fn metadata(request: &RenderRequest, result: &RunResult, error: &FilmError, format: Format) -> Metadata {
    let settings = &result.plan.settings;
    let confidence = settings.stop.confidence;
    let [error, error_bound] = errors(error, confidence);
    let request = kept(request);
    let builder = result.device.is_none().then_some(Variant::Of(Builder::Cpu));
    let with_rounds = RenderRequest { rounds: Some(result.film.rounds), variant: builder, ..request.clone() };
    Metadata {
        photonmill: env!("CARGO_PKG_VERSION").to_owned(),
        devices: devices_of(result),
        scene: "open-box".to_owned(),
        scene_hash: None,
        seed: settings.seed,
        rounds: result.film.rounds,
        degrees_of_freedom: result.film.error_freedom(),
        error,
        error_bound,
        confidence,
        denoiser: None,
        units: match format {
            Format::Png => "the paper's illumination, from 0 to 1 as codes from 0 to 255".to_owned(),
            Format::Exr => "the paper's illumination, not clamped to 1".to_owned(),
        },
        command: command_line("", &with_rounds, &["-o", name_in_text(format)]),
        settings: settings_with_effect(settings),
        repeat: match result.end {
            End::Rounds | End::Error | End::Photons => Repeat::With {
                command: String::new(),
                arguments: request.words(),
                division: Division::of(&SceneSettings::default()),
                tiles: None,
            },
            // A round may be cut short then.
            End::Time | End::Cancelled => {
                Repeat::Not("was ended early, at a moment that no other run meets; run it with `rounds` instead".to_owned())
            }
        },
    }
}

fn devices_of(result: &RunResult) -> Vec<String> {
    let devices = devices(result.device.iter().chain(&result.more_devices));
    if devices.is_empty() { vec!["cpu".to_owned()] } else { devices }
}
