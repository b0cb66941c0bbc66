//! Options of the commands that light a scene of triangles: the scene, how it is lit, what a camera sees of it.

use clap::Args;

use super::options::CommonArgs;
use super::picture_size::{PictureSize, parse_size};
use super::progress::ProgressReporter;
use super::stop::StopArgs;
use super::values::{BuilderArg, SwitchArg, builder_parser, effect_parser, parse_colour, parse_integer, parse_number, value_enum};
use super::{complain, help};
use crate::error::{Error, Result};
use crate::plan::sensor::Sensor;
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
    /// Aim photons of the caustic map at mirrors and glass (projection maps), and light of a sky or sun at the openings that it comes in through [default: on]
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
    #[arg(long, value_name = "EFFECT", value_parser = effect_parser(), value_delimiter = ',', help_heading = "Light transport")]
    with: Vec<Effect>,
    /// Leave an effect out even if the scene needs it
    #[arg(long, value_name = "EFFECT", value_parser = effect_parser(), value_delimiter = ',', help_heading = "Light transport")]
    without: Vec<Effect>,

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
    /// Camera by name [default: the first one; one that sees the whole scene if it has none]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    camera: Option<String>,
    /// Size of the picture in pixels; a width alone takes its height from the camera's aspect ratio [default: about 307200
    /// pixels in the camera's aspect ratio, 640x480 if it has none]
    #[arg(long, value_name = "WIDTH[xHEIGHT]", value_parser = parse_size, allow_hyphen_values = true, help_heading = "Scene")]
    size: Option<PictureSize>,
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
        let CommonArgs { seed, edge_correction, math, chunk, group_size, paranoid } = self.common;
        SceneSettings {
            photons,
            caustic_photons,
            rounds: self.rounds.unwrap_or_else(|| most_rounds(&stop, photons.min(caustic_photons)).unwrap_or(usual.rounds)),
            stop,
            bounces: self.bounces.unwrap_or(usual.bounces),
            seed: seed.unwrap_or(usual.seed),
            radius: self.radius,
            caustic_radius: self.caustic_radius,
            alpha: if self.fixed_radius { 1.0 } else { self.alpha.unwrap_or(usual.alpha) },
            kernel: self.kernel.map_or(usual.kernel, Kernel::from),
            edge_correction: edge_correction.map_or(usual.edge_correction, |switch| switch == SwitchArg::On),
            shadow_rays: self.shadow_rays.unwrap_or(usual.shadow_rays),
            final_gather: self.final_gather,
            aim: self.aim.map_or(usual.aim, |switch| switch == SwitchArg::On),
            illumination: self.illumination.map_or(usual.illumination, Illumination::from),
            builder: self.variant.unwrap_or(usual.builder),
            math: math.map_or(usual.math, Math::from),
            paranoid,
            group_size: group_size.unwrap_or(usual.group_size),
            chunk,
            with: self.with.clone(),
            without: self.without.clone(),
            ..usual
        }
    }
}

impl PictureArgs {
    pub(super) fn settings(&self) -> SceneSettings {
        let usual = self.transport.settings();
        SceneSettings { part: self.part.map_or(usual.part, Part::from), ..usual }
    }

    pub(super) fn open(&self, settings: &SceneSettings, reporter: &ProgressReporter) -> Result<Subject> {
        let scene = self.scene.open(reporter)?;
        let camera = camera(&scene, self.camera.as_deref())?;
        let (width, height) = PictureSize::resolve(self.size, &camera, reporter)?;
        let geometry = geometry(&scene, settings, reporter)?;
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
    if geometry.left_out > 0 {
        let count = counted(geometry.left_out, "triangle");
        complain(&format!("warning: {count} without area in single precision, or on others, left out"));
    }
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

/// The camera by name, else the scene's first, else one that sees all of it.
fn camera(scene: &Scene, name: Option<&str>) -> Result<Camera> {
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
