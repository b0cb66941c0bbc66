//! An image: what a camera sees of a scene, and its file.

use std::path::Path;
use std::sync::Arc;

use super::checkpoints::Checkpoints;
use super::denoise::{self, denoised};
use super::events::Observer;
use super::options::ROWS;
use super::prepare::{Inputs, Prepared, RequestedReceivers, Run};
use super::request::RenderRequest;
use super::scene::PreparedScene;
use super::values::Form;
use crate::engine::run::identity::settings_with_effect;
use crate::engine::run::saved::SavedRun;
use crate::engine::run::watch::End;
use crate::engine::scene::RunResult;
use crate::error::{Result, require};
use crate::gpu::Gpu;
use crate::oidn::Denoiser;
use crate::output::colour::Format;
use crate::output::destination::{Destination, write_all};
use crate::output::metadata::{Metadata, Repeat, devices, errors};
use crate::output::show::{Layer, Show, Surface, surfaces, units};
use crate::plan::work_division::Division;
use crate::scene::{Camera, Scene};
use crate::settings::scene::{Part, SceneSettings};
use crate::settings::tile_samples::TileSamples;
use crate::text::quoted;

/// Row by row from the top, W/m2/sr.
pub struct Image {
    pub run: Run,
    pub request: RenderRequest,
    pub scene: Arc<Scene>,
    pub camera: Camera,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// SHA-256 of the scene as kernels read it.
    pub scene_hash: String,
    /// Whether the scene is what the request names, so that the request makes the image again.
    is_of_request: bool,
    /// The blocks that a resumed run began with have others between them that were not done, up to so many.
    blocks_with_gaps: u32,
}

impl PreparedScene {
    /// What a camera sees, that of the request unless another one is given. An image of which nothing says when it ends, ends at an error of
    /// 2 %, or after a time that suits the device.
    pub fn render(&self, gpus: &mut Vec<Gpu>, camera: Option<&Camera>, request: &RenderRequest, observer: &Observer) -> Result<Image> {
        request.check_camera()?;
        let inputs = Inputs::open(request)?.ended(gpus[0].facts().kind);
        let mut checkpoints = Checkpoints::open(request, observer)?;
        let inputs = inputs.for_image(true, checkpoints.resumed())?;
        let prepared = self.prepare(inputs, RequestedReceivers::Image(camera), observer)?;
        let image = prepared.image(gpus, &mut checkpoints, observer)?;
        checkpoints.finish()?;
        let asked = self.asked(request).filter(|_| camera.is_none());
        Ok(Image { is_of_request: asked.is_some(), request: asked.unwrap_or_else(|| request.clone()), ..image })
    }
}

impl Inputs {
    /// For an image: keeps the parts of each pixel's light apart where they are shown, but not of a run that goes on with one that has none.
    /// Fails where the image is to be denoised and cannot be.
    pub(crate) fn for_image(mut self, shows_parts: bool, resumed: Option<&SavedRun>) -> Result<Self> {
        self.denoiser = self.request.denoise.then(|| denoise::open(&self.settings, resumed)).transpose()?;
        self.settings.keeps_parts = (shows_parts || self.request.denoise) && resumed.is_none_or(SavedRun::has_parts);
        Ok(self)
    }
}

impl Prepared {
    /// Runs to the end; the image is what came of it.
    pub(crate) fn image(&self, gpus: &mut Vec<Gpu>, checkpoints: &mut Checkpoints, observer: &Observer) -> Result<Image> {
        let blocks_with_gaps = blocks_with_gaps(checkpoints.resumed());
        let run = self.run(gpus, checkpoints, observer)?;
        Ok(Image {
            run,
            request: self.inputs.request.clone(),
            scene: self.scene.clone(),
            camera: self.camera.clone().expect("an image has a camera"),
            size: self.size(),
            scene_hash: self.scene_hash(),
            is_of_request: true,
            blocks_with_gaps,
        })
    }
}

/// The blocks up to the last one of a resumed run that lacks some of them; 0 where it lacks none.
fn blocks_with_gaps(resumed: Option<&SavedRun>) -> u32 {
    resumed.map(|run| run.done.end()).filter(|end| resumed.is_some_and(|run| run.done.count() < *end)).unwrap_or(0)
}

/// How the image of a request is shown.
pub(crate) fn show(request: &RenderRequest, size: (u32, u32)) -> Show {
    let layers = request.layers.as_ref().map_or(Layer::ALL.into(), |layers| layers.0.clone());
    Show {
        size,
        exposure: request.exposure.map(|stops| stops.0),
        tone: request.tone.unwrap_or_default(),
        white_balance: request.white_balance,
        layers,
        denoised: None,
    }
}

/// Refuses what the format of an image's file does not have.
pub(crate) fn check_format(request: &RenderRequest, path: Option<&Path>) -> Result<()> {
    let format = path.map(|path| Format::of("output", path)).transpose()?;
    let name = || path.map_or_else(|| "(no file)".to_owned(), |path| path.display().to_string());
    let of_png = "is for PNG only: an EXR holds linear radiance";
    if let Some(exposure) = request.exposure {
        require(format == Some(Format::Png), "exposure", exposure.0, of_png)?;
    }
    if let Some(kelvin) = request.white_balance {
        require(format == Some(Format::Png), "white_balance", kelvin, of_png)?;
    }
    if request.layers.is_some() && path.is_some() {
        require(format == Some(Format::Exr), "layers", name(), "is for EXR only: a PNG holds what the eye sees")?;
    }
    require(request.tone.is_none() || format == Some(Format::Png), "tone", name(), of_png)
}

/// Under whatever name an image is written: equal results are equal files.
pub(crate) fn name_in_text(format: Format) -> &'static str {
    if format == Format::Png { "picture.png" } else { "picture.exr" }
}

impl Image {
    /// Writes a `.png` for the eye, or an `.exr` of linear radiance with layers, as the file's name ends and the request asks.
    pub fn save(&self, path: impl AsRef<Path>, observer: &Observer) -> Result<()> {
        self.save_as(path.as_ref(), &self.request, observer)
    }

    /// The same with the exposure, the tone and the layers of another request.
    pub fn save_as(&self, path: &Path, style: &RenderRequest, observer: &Observer) -> Result<()> {
        let format = Format::of("output", path)?;
        let destination = Destination::open("output", path)?;
        write_all([(destination, self.file(style, format, observer).0)])
    }

    /// The content of such a file, and in words its exposure and who has changed it.
    pub fn file(&self, style: &RenderRequest, format: Format, observer: &Observer) -> (Vec<u8>, String) {
        // An EXR has none, and its command must not ask for it.
        let style = &RenderRequest { white_balance: style.white_balance.filter(|_| format == Format::Png), ..style.clone() };
        let show = show(style, self.size);
        let film = &self.run.film;
        let has_layers = format == Format::Exr && show.shows_surfaces();
        // It was there before the run; its device belongs to one thread.
        let denoiser = self.request.denoise.then(Denoiser::open).transpose().unwrap_or_else(|error| {
            observer.warn(format!("{error}; the picture is as it was rendered"));
            None
        });
        let surfaces = if has_layers || denoiser.is_some() { self.surfaces() } else { Vec::new() };
        let denoised = denoiser
            .as_ref()
            .and_then(|denoiser| Some((denoised(denoiser, film, &surfaces, self.size, observer)?, denoise::name(denoiser))));
        let (denoised, denoiser) = denoised.unzip();
        let by = denoiser.as_ref().map_or_else(String::new, |denoiser| {
            format!("\ndirect light is denoised by {denoiser}; all errors are those of the picture before that, and layers are as rendered")
        });
        let show = Show { denoised, ..show };
        let metadata = |stops: f32| Metadata { denoiser: denoiser.clone(), ..self.metadata(style, units(format, stops, &show), format) };
        if format == Format::Png {
            let (content, stops) = show.png(film, metadata);
            return (content, format!(" at {stops:+.2} stops{by}"));
        }
        (show.exr(film, &surfaces, Some(&metadata(0.0))), by)
    }

    /// What each pixel sees first.
    pub fn surfaces(&self) -> Vec<Surface> {
        surfaces(&self.scene.without(&self.run.plan.settings.without), &self.camera, self.size)
    }

    /// Why layers of the parts of its light are missing, where they are asked for.
    pub fn missing_parts(&self, asked: &SceneSettings) -> Option<&'static str> {
        if asked.part != Part::All || self.run.film.parts.is_some() {
            return None;
        }
        Some(match (asked.keeps_parts, self.run.plan.keeps_parts()) {
            (false, _) => "the checkpoint of `resume` is of a run without -o FILE.exr",
            (true, false) => "the picture is too large for the device with them",
            (true, true) => "it was cut short within its first block of rounds",
        })
    }

    pub fn devices(&self) -> Vec<String> {
        devices(self.run.device.iter().chain(&self.run.more_devices))
    }

    /// Why the image cannot be made again, if it cannot.
    fn obstacle(&self) -> Option<&'static str> {
        let run = &self.run.result;
        let per_round: u64 = run.plan.maps().map(|map| u64::from(map.photons)).sum();
        let is_early = matches!(run.end, End::Time | End::Cancelled);
        if !self.is_of_request {
            Some("is of a scene or a camera that a call of the library made; repeat the call")
        } else if self.request.shard.is_some() {
            Some("holds a shard of a run; repeat the picture of all shards, from the run without `shard`")
        } else if run.film.rounds == 1 && is_early && run.ledger().emitted < per_round {
            Some("was cut short within its first round, at a moment that no other run meets; render it with `rounds` instead")
        } else if self.blocks_with_gaps > run.film.blocks || (is_early && !run.more_devices.is_empty()) {
            Some("may hold blocks of rounds with others missing between them; render it with `rounds` instead")
        } else {
            None
        }
    }

    fn metadata(&self, style: &RenderRequest, units: String, format: Format) -> Metadata {
        let (run, scene, output) = (&self.run.result, &self.scene.name, name_in_text(format));
        let settings = &run.plan.settings;
        let confidence = settings.stop.confidence;
        let [error, error_bound] = errors(&run.error(), confidence);
        let is_even = settings.tiles.as_ref().is_none_or(|tiles: &TileSamples| tiles.most() == 0);
        let command = match (self.is_of_request, is_even) {
            (false, _) => "none, as it was made by a call of the library".to_owned(),
            (true, true) => command(style, run, output),
            // No option says which tiles have more samples.
            (true, false) => format!("photonmill repeat {output}"),
        };
        let repeat = match self.obstacle() {
            Some(reason) => Repeat::Not(reason.to_owned()),
            None => Repeat::With {
                command: "render".to_owned(),
                arguments: kept(style).words(),
                division: Division::of(settings),
                tiles: settings.tiles.clone(),
            },
        };
        Metadata {
            photonmill: env!("CARGO_PKG_VERSION").to_owned(),
            devices: self.devices(),
            scene: scene.clone(),
            scene_hash: Some(self.scene_hash.clone()),
            seed: settings.seed,
            rounds: run.film.rounds,
            degrees_of_freedom: run.film.error_freedom(),
            error,
            error_bound,
            confidence,
            denoiser: None,
            units,
            command,
            settings: settings_with_effect(settings),
            repeat,
        }
    }
}

/// A request with nothing in it but what decides its image, however much work is done for it.
pub(crate) fn kept(request: &RenderRequest) -> RenderRequest {
    request.only(|row| row.is_kept(request))
}

/// The command line that makes the image of a run again, with what each round did where that is not what it does without saying so.
fn command(request: &RenderRequest, run: &RunResult, output: &str) -> String {
    let [usual, used] = [&SceneSettings::default(), &run.plan.settings].map(Division::of);
    // Photons of a file are as many as they are.
    let traces = request.map.is_none();
    let some = |value: u32, is_needed: bool| is_needed.then_some(value);
    let request = RenderRequest {
        photons: some(used.photons, used.photons != usual.photons && traces),
        caustic_photons: some(used.caustic_photons, used.caustic_photons != used.photons && traces),
        samples: some(used.samples, used.samples != usual.samples),
        shadow_rays: some(used.shadow_rays, used.shadow_rays != usual.shadow_rays),
        neighbours: some(used.neighbours, used.neighbours != usual.neighbours),
        caustic_neighbours: some(used.caustic_neighbours, used.caustic_neighbours != (used.neighbours / 4).max(1)),
        rounds: Some(run.film.rounds),
        ..kept(request)
    };
    command_line("render", &request, &["-o", output])
}

/// A command line for a shell, with options that are no request's at its end.
pub(crate) fn command_line(command: &str, request: &RenderRequest, others: &[&str]) -> String {
    let options = ROWS.iter().filter_map(|row| Some((row, row.text(request)?))).flat_map(|(row, value)| {
        let value = (row.form() != Form::Flag).then_some(value);
        [Some(format!("--{}", row.option())), value].into_iter().flatten()
    });
    let words = ["photonmill", command, &request.scene].into_iter().filter(|word| !word.is_empty()).map(str::to_owned).chain(options);
    words.chain(others.iter().map(|word| (*word).to_owned())).map(quoted).collect::<Vec<String>>().join(" ")
}
