//! Options of the commands that light a scene of triangles: the scene, how it is lit, what a camera sees of it.

use std::path::{Path, PathBuf};

use clap::Args;

use super::camera::CameraArgs;
use super::chosen::{Chosen, ChosenArgs};
use super::keep::KeepArgs;
use super::options::CommonArgs;
use super::progress::ProgressReporter;
use super::stop::StopArgs;
use super::values::{BuilderArg, SwitchArg, builder_parser, effect_parser, parse_colour, parse_integer, parse_number, value_enum};
use super::{complain, help};
use crate::engine::scene::map_file::MapFile;
use crate::error::{Error, Result, require};
use crate::output::colour::Tone;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::Free;
use crate::scene::geometry::Geometry;
use crate::scene::surroundings::{Environment, Surroundings};
use crate::scene::{Camera, Reading, Scene, built_in};
use crate::settings::request::Request;
use crate::settings::scene::{Effect, Filter, Illumination, Kernel, Part, SceneSettings};
use crate::settings::{Builder, Math};
use crate::text::counted;

#[derive(Args)]
pub(super) struct SceneArgs {
    #[arg(value_name = "SCENE", help = help::scene())]
    pub(super) scene: String,
    /// Take the intensities of the lights of a glTF file as W/sr and W/m2 [default: candela and lux, divided by 683 lm/W]
    #[arg(long, help_heading = "Scene")]
    radiometric: bool,
    /// Take nodes, skins and morph targets as the file's first animation has them at this time [default: at rest]
    #[arg(long, value_name = "SECONDS", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    at: Option<f64>,
    /// Light from beyond the scene in place of the file's own: W/m2/sr, one number or three for red, green and blue, or a picture of
    /// all directions (equirectangular, .hdr or .exr) [default: the file's; 1 if nothing in the file emits light]
    #[arg(long, value_name = "R,G,B|FILE", value_parser = parse_environment, allow_hyphen_values = true, help_heading = "Scene")]
    environment: Option<Environment>,
    /// Add a sun, degrees clockwise from -z as seen from above and above the horizon, and the clear sky that belongs to it unless
    /// --environment is given
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_sun, allow_hyphen_values = true, help_heading = "Scene")]
    sun: Option<[f64; 2]>,
    /// Turn the environment's picture about the vertical, degrees, counter-clockwise as seen from above; not the sky of --sun
    #[arg(long, value_name = "DEGREES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    environment_rotate: Option<f64>,
    /// Multiply the environment's light, or that of --sun and its sky
    #[arg(long, value_name = "FACTOR", value_parser = parse_number::<f32>, allow_hyphen_values = true, help_heading = "Scene")]
    environment_strength: Option<f32>,
}

fn parse_sun(text: &str) -> std::result::Result<[f64; 2], String> {
    let degrees: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    match degrees[..] {
        [azimuth, elevation] if text.split(',').count() == 2 && azimuth.is_finite() && elevation > 0.0 && elevation <= 90.0 => {
            Ok([azimuth, elevation])
        }
        _ => Err("must be two numbers, AZIMUTH,ELEVATION in degrees; the elevation above 0 and at most 90".into()),
    }
}

fn parse_environment(text: &str) -> std::result::Result<Environment, String> {
    let path = Path::new(text);
    let is_picture =
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("hdr") || extension.eq_ignore_ascii_case("exr"));
    match is_picture {
        true => Ok(Environment::Picture(path.to_owned())),
        false => parse_colour(text).map(Environment::Colour).map_err(|reason| format!("{reason}; or a file that ends in .hdr or .exr")),
    }
}

/// Which photons are traced, through what.
#[derive(Args)]
pub(super) struct PhotonArgs {
    /// Photons of the global map, per round [default: 131072; what a pilot finds best of a picture that ends at an error or a time]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    pub(super) photons: Option<u32>,
    /// Photons of the caustic map, per round [default: the same as --photons; what a pilot finds best]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    pub(super) caustic_photons: Option<u32>,
    /// Cut photons off after this many bounces [default: none; Russian roulette ends paths]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    bounces: Option<u32>,
    /// Aim photons of the caustic map at mirrors and glass (projection maps), and light of a sky or sun at the openings that it comes in through [default: on]
    #[arg(long, value_enum, value_name = "SWITCH", help_heading = "Photons")]
    aim: Option<SwitchArg>,

    /// Source of direct light and caustics [default: split]
    #[arg(long, value_enum, value_name = "METHOD", help_heading = "Light transport")]
    illumination: Option<IlluminationArg>,
    #[command(flatten)]
    pub(super) chosen: ChosenArgs,
    /// Simulate an effect even if the scene does not need it; `photonmill plan` lists them
    #[arg(long, value_name = "EFFECT", value_parser = effect_parser(), value_delimiter = ',', help_heading = "Light transport")]
    with: Vec<Effect>,
    /// Leave an effect out even if the scene needs it
    #[arg(long, value_name = "EFFECT", value_parser = effect_parser(), value_delimiter = ',', help_heading = "Light transport")]
    without: Vec<Effect>,
}

#[derive(Args)]
pub(super) struct TransportArgs {
    #[command(flatten)]
    pub(super) stop: StopArgs,
    #[command(flatten)]
    pub(super) keep: KeepArgs,

    #[command(flatten)]
    pub(super) light: PhotonArgs,
    /// Take the photons from a file of `photonmill map` instead of tracing them: the same light for another camera, radius or kernel
    #[arg(long, value_name = "FILE", help_heading = "Photons", conflicts_with_all = ["photons", "caustic_photons", "bounces", "aim", "illumination"])]
    map: Option<PathBuf>,
    /// Number of independent rounds, of which the result is the mean [default: as many as the goals take, up to 65536;
    /// 32 of points, texels and shards without a goal]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    rounds: Option<u32>,
    /// Rounds of a block, a power of two. Samples are even over a block, and errors come from the spread of blocks; --rounds is
    /// rounded up to whole blocks [default: 4, less with more --samples]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    block: Option<u32>,
    /// Shadow rays per visible point and round [default: 4; what a pilot finds best of a picture that ends at an error or a time]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Light transport")]
    pub(super) shadow_rays: Option<u32>,
    /// Final gathering: take indirect light from one ray to the next surface, not from the map at the visible point
    #[arg(long, help_heading = "Light transport")]
    final_gather: bool,

    /// Photons of a round that the first radius of the global map is to hold at the median pixel, texel or point, as a trial finds it
    /// [default: 24; what a pilot finds best of a picture that ends at an error or a time]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Density estimate")]
    neighbours: Option<u32>,
    /// The same for the caustic map [default: 6, or a quarter of --neighbours; or what a pilot finds best]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Density estimate")]
    caustic_neighbours: Option<u32>,
    /// Radius of the density estimate of the global map in the first round, metres [default: what holds --neighbours]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Density estimate")]
    radius: Option<f64>,
    /// The same for the caustic map [default: what holds --caustic-neighbours]
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
    #[arg(long, value_name = "BUILDER", help_heading = "Implementation", value_parser = builder_parser(Builder::ON_GPU,
        "Persistent; ballot with --math strict, and where the device fails the check of what persistent needs"))]
    variant: Option<BuilderArg>,
    #[command(flatten)]
    common: CommonArgs,
}

/// What a camera sees of a scene, and how it is lit.
#[derive(Args)]
pub(super) struct PictureArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    pub(super) transport: TransportArgs,
    /// Compute only this part of the light; the four parts sum to `all` exactly
    #[arg(long, value_enum, value_name = "PART", help_heading = "Light transport")]
    part: Option<PartArg>,
}

/// What a picture is made of.
pub(super) struct Subject {
    pub(super) scene: Scene,
    pub(super) camera: Camera,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) geometry: Geometry,
}

value_enum!(IlluminationArg => Illumination {
    /// Direct light by shadow rays, caustics from a map of their own, the rest from the global map
    Split,
    /// Everything from one photon map, as in the paper
    Photons,
});

value_enum!(KernelArg => Kernel { Box, Cone, Epanechnikov });
value_enum!(FilterArg => Filter {
    /// The square of the pixel
    Box,
    /// A tent two pixels wide
    Tent,
    /// A Gaussian with a standard deviation of half a pixel
    Gaussian,
});
value_enum!(ToneArg => Tone {
    /// Highlights keep their shape: Khronos PBR Neutral
    Neutral,
    /// What is brighter than white is white
    Linear,
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

impl SceneArgs {
    /// Of the scene's file, or the name of a built-in one.
    pub(super) fn path(&self) -> &Path {
        Path::new(&self.scene)
    }

    /// The scene; prints its warnings.
    pub(super) fn open(&self, reporter: &ProgressReporter) -> Result<Scene> {
        if let Some(time) = self.at {
            require(time.is_finite(), "--at", time, "must be finite")?;
        }
        let surroundings = self.surroundings();
        surroundings.validate()?;
        let reading = Reading { radiometric: self.radiometric, at: self.at };
        let mut scene = Scene::open_with(&self.scene, reading, &mut stages(&self.scene, reporter))?;
        let note = surroundings.light(&mut scene)?;
        for warning in &scene.warnings {
            complain(&format!("warning: {warning}"));
        }
        note.iter().for_each(|note| complain(&format!("note: {note}")));
        Ok(scene)
    }

    fn surroundings(&self) -> Surroundings {
        let &SceneArgs { sun, environment_rotate: rotate, environment_strength: strength, .. } = self;
        Surroundings { environment: self.environment.clone(), sun, rotate, strength }
    }
}

impl PhotonArgs {
    pub(super) fn request(&self, common: &CommonArgs) -> Request {
        let &CommonArgs { seed, math, chunk, group_size, paranoid } = common;
        Request {
            photons: self.photons,
            caustic_photons: self.caustic_photons,
            bounces: self.bounces,
            aim: self.aim.map(|switch| switch == SwitchArg::On),
            illumination: self.illumination.map(Illumination::from),
            with: self.with.clone(),
            without: self.without.clone(),
            seed,
            math: math.map(Math::from),
            chunk,
            group_size,
            paranoid,
            ..Request::default()
        }
    }
}

impl TransportArgs {
    /// Files that are read.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.map.iter().map(PathBuf::as_path).chain(self.light.chosen.inputs())
    }

    /// The file that photons are taken from.
    pub(super) fn map(&self) -> Result<Option<MapFile>> {
        let Some(map) = self.map.as_ref().map(|path| MapFile::open("--map", path)).transpose()? else { return Ok(None) };
        if let Some(rounds) = self.rounds.filter(|rounds| *rounds > map.rounds()) {
            return Err(Error::setting(
                "--rounds",
                rounds,
                format!("must be at most {}, the rounds that the file of --map holds", map.rounds()),
            ));
        }
        Ok(Some(map))
    }

    /// What a pilot may choose of a run of a picture that ends at a goal; shards must not choose each for itself.
    pub(super) fn free(&self, request: &Request) -> Free {
        if self.keep.shard.is_some() || self.light.chosen.is_given() {
            return Free::default();
        }
        let free = Free::of(request);
        let traces = self.map.is_none();
        Free { photons: traces && free.photons, caustic_photons: traces && free.caustic_photons, ..free }
    }

    /// Whether nothing says when a run ends.
    pub(super) fn has_no_end(&self) -> bool {
        self.request().has_no_end() && self.map.is_none() && self.keep.shard.is_none() && !self.light.chosen.is_given()
    }

    pub(super) fn request(&self) -> Request {
        Request {
            stop: self.stop.stop(),
            rounds: self.rounds,
            block: self.block,
            neighbours: self.neighbours,
            caustic_neighbours: self.caustic_neighbours,
            radius: self.radius,
            caustic_radius: self.caustic_radius,
            alpha: if self.fixed_radius { Some(1.0) } else { self.alpha },
            kernel: self.kernel.map(Kernel::from),
            edge_correction: self.edge_correction.map(|switch| switch == SwitchArg::On),
            shadow_rays: self.shadow_rays,
            final_gather: self.final_gather,
            builder: self.variant.flatten(),
            ..self.light.request(&self.common)
        }
    }
}

/// Settings that are usual, or chosen before, but for what is asked for; and for the photons of a file.
pub(super) fn settings(request: &Request, map: Option<&MapFile>, chosen: Option<&Chosen>) -> SceneSettings {
    let settings = request.settings(chosen.map(Chosen::settings).as_ref());
    match map {
        Some(map) => SceneSettings { rounds: request.rounds.unwrap_or(map.rounds()), ..map.settings(&settings) },
        None => settings,
    }
}

impl PictureArgs {
    /// Files that are read.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.transport.inputs().chain([self.scene.path()])
    }

    /// Takes the scene from somewhere else.
    pub(super) fn set_scene(&mut self, scene: String) {
        self.scene.scene = scene;
    }

    pub(super) fn scene_path(&self) -> &Path {
        self.scene.path()
    }

    /// Whether there is nothing of this name, neither a file nor a built-in scene.
    pub(super) fn lacks_scene(&self) -> bool {
        !self.scene.path().exists() && !built_in::names().contains(&self.scene.scene.as_str())
    }

    pub(super) fn request(&self) -> Request {
        Request { part: self.part.map(Part::from), ..self.transport.request() }
    }

    pub(super) fn open(&self, settings: &SceneSettings, reporter: &ProgressReporter) -> Result<Subject> {
        self.camera.check()?;
        let scene = self.scene.open(reporter)?;
        let (camera, [width, height]) = self.camera.resolve(&scene, reporter)?;
        let geometry = geometry(&scene, settings, reporter)?;
        geometry.place_warning("the camera", [camera.eye]).iter().for_each(|line| complain(&format!("warning: {line}")));
        Ok(Subject { scene, camera, width, height, geometry })
    }
}

impl Subject {
    pub(super) fn sensor(&self) -> Sensor {
        Sensor::Picture { width: self.width, height: self.height }
    }
}

/// Geometry of a scene without the effects that are left out.
pub(super) fn geometry(scene: &Scene, settings: &SceneSettings, reporter: &ProgressReporter) -> Result<Geometry> {
    let what = format!("{} ({})", scene.name, counted(scene.triangle_count(), "triangle"));
    let geometry = Geometry::new_with(&scene.without(&settings.without), &mut stages(&what, reporter))?;
    geometry.warnings(scene).iter().for_each(|line| complain(&format!("warning: {line}")));
    Ok(geometry)
}

/// Reports the stages of loading `what`, each at its start and at every tenth of it.
pub(super) fn stages<'a>(what: &'a str, reporter: &'a ProgressReporter) -> impl FnMut(&'static str, f64) + 'a {
    let mut reported = None;
    move |stage, done| {
        let step = (stage, (10.0 * done) as u32);
        if reported.replace(step) != Some(step) {
            reporter.status(&format!("{what}: {stage}, {} %", 10 * step.1));
        }
    }
}
