//! From a scene to a picture, to the light at points or to lightmaps, in a few lines: what the commands `render`, `probe` and `bake` do, with
//! the same defaults and the same bits, but without their options and messages. The Python module stands on it.
//!
//! The crate's page makes a picture. This is the irradiance at a point, to an error of 20 %, whatever rounds that takes:
//!
//! ```
//! use glam::DVec3;
//! use photonmill::engine::Control;
//! use photonmill::gpu::{Gpu, Options};
//! use photonmill::render::{PreparedScene, Request};
//! use photonmill::settings::stop::Stop;
//!
//! let mut gpus = vec![Gpu::open(&Options::default())?];
//! let scene = PreparedScene::open("cornell")?;
//! let request = Request { stop: Stop { error: Some(0.2), ..Stop::default() }, photons: Some(4096), ..Request::default() };
//! let points = [(DVec3::new(0.5, 0.001, 0.5), DVec3::Y)];
//! let run = scene.probe(&mut gpus, &points, &request, &mut Control::default())?;
//! println!("{} W/m2, with an error of {}", run.film.mean(0), run.film.stated_error(0));
//! # assert!(run.film.mean(0).x > 0.0 && run.film.stated_error(0).x < run.film.mean(0).x);
//! # Ok::<(), photonmill::error::Error>(())
//! ```
//!
//! Lightmaps, as values and as the files of `photonmill bake`:
//!
//! ```
//! # use photonmill::engine::Control;
//! # use photonmill::gpu::{Gpu, Options};
//! # use photonmill::render::{BakeRequest, PreparedScene, Request};
//! use photonmill::output::destination::Folder;
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(folder.path()).unwrap();
//!
//! # let mut gpus = vec![Gpu::open(&Options::default())?];
//! let scene = PreparedScene::open("cornell")?;
//! let folder = Some(Folder::open("-o", "baked".as_ref())?);
//! let bake = BakeRequest { folder, texels_per_metre: Some(2.0), ..BakeRequest::default() };
//! let request = Request { rounds: Some(8), photons: Some(4096), ..Request::default() };
//! let lightmaps = scene.bake(&mut gpus, &bake, &request, &mut Control::default())?;
//! let floor = &lightmaps.maps[0];
//! println!("{}: {} x {} texels, the first of {} W/m2", floor.name, floor.width, floor.height, floor.irradiance[0]);
//! # assert!(lightmaps.files.iter().all(|file| std::path::Path::new("baked").join(file).is_file()) && floor.irradiance[0].x > 0.0);
//! # Ok::<(), photonmill::error::Error>(())
//! ```

mod lightmaps;
mod picture;

use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use glam::DVec3;

use crate::engine::retry::{in_words, until_done};
use crate::engine::scene::pilot::{self, Pilot};
use crate::engine::scene::{RunResult, Target, View, bias, light_on, scene_hash, trial};
use crate::engine::watch::Control;
use crate::error::{Error, Result, require};
use crate::gpu::Gpu;
use crate::output::scene_report;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::Free;
use crate::scene::geometry::Geometry;
use crate::scene::picture_size::PictureSize;
use crate::scene::sensors::with_sensors;
use crate::scene::surroundings::Surroundings;
use crate::scene::{Camera, Reading, Scene, built_in};
use crate::settings::request::{GOOD_ERROR, MOST_ROUNDS, longest_seconds};
use crate::settings::scene::SceneSettings;

pub use crate::settings::request::Request;
pub use lightmaps::{BakeRequest, Lightmap, Lightmaps};
pub use picture::{Picture, Style};

/// A scene with what takes a while to make of it.
pub struct PreparedScene {
    pub scene: Arc<Scene>,
    geometry: Geometry,
    /// Of its file; `None` where it has none.
    path: Option<PathBuf>,
    /// What its user should know of it.
    pub warnings: Vec<String>,
}

/// A run and what is to be said of it.
pub struct Run {
    pub result: RunResult,
    /// What a pilot chose; `None` where there was nothing to choose.
    pub pilot: Option<Pilot>,
    /// Wall time of all of it, pilot and trial included.
    pub seconds: f64,
    pub warnings: Vec<String>,
}

impl Deref for Run {
    type Target = RunResult;

    fn deref(&self) -> &RunResult {
        &self.result
    }
}

/// Points of one run at most: their numbers are 32-bit.
pub const MAX_POINTS: usize = 1 << 28;
/// Metres: the square of anything larger would leave f32's range once normalised.
const MAX_COORDINATE: f64 = 1e15;

/// A point and the normal of its surface, of any length but 0; fails with what is wrong with them.
pub fn point_of(position: [f64; 3], normal: [f64; 3]) -> std::result::Result<(DVec3, DVec3), String> {
    if let Some(value) = position.iter().chain(&normal).find(|value| value.is_nan() || value.abs() > MAX_COORDINATE) {
        return Err(format!("holds {value}; numbers must be from -{MAX_COORDINATE:e} to {MAX_COORDINATE:e}"));
    }
    let normal = DVec3::from(normal);
    if normal == DVec3::ZERO {
        return Err("has a normal of length 0".to_owned());
    }
    Ok((DVec3::from(position), (normal / normal.abs().max_element()).normalize()))
}

/// What looks at a scene.
struct Looking<'a> {
    view: View<'a>,
    sensor: Sensor,
    /// Pixel, texel or point.
    point: &'static str,
}

impl PreparedScene {
    /// A built-in scene by name, else a `.gltf` or `.glb` file. A scene that nothing lights gets an even sky.
    pub fn open(name: &str) -> Result<PreparedScene> {
        PreparedScene::read(name, Reading::default(), &Surroundings::default())
    }

    /// The same, read as is asked for, in other surroundings.
    pub fn read(name: &str, reading: Reading, surroundings: &Surroundings) -> Result<PreparedScene> {
        surroundings.validate()?;
        if let Some(time) = reading.at {
            require(time.is_finite(), "--at", time, "must be finite")?;
        }
        let mut scene = Scene::open_with(name, reading, &mut |_, _| {})?;
        let note = surroundings.light(&mut scene)?;
        let path = built_in::by_name(name).is_none().then(|| PathBuf::from(name));
        let mut prepared = PreparedScene::new(scene)?;
        prepared.path = path;
        prepared.warnings.extend(note.map(str::to_owned));
        Ok(prepared)
    }

    /// A scene as it is.
    pub fn new(scene: Scene) -> Result<PreparedScene> {
        let geometry = Geometry::new(&scene)?;
        let warnings = [scene.warnings.clone(), geometry.warnings(&scene)].concat();
        Ok(PreparedScene { scene: Arc::new(scene), geometry, path: None, warnings })
    }

    /// What a camera sees: radiance. Without one it is the scene's first; or one that sees all of it, where there is none. The size is that of
    /// the program where it is left out. A request that says nothing of its end ends at an error of 2 %, or after the time that the program
    /// takes at most.
    pub fn render(
        &self,
        gpus: &mut Vec<Gpu>,
        camera: Option<&Camera>,
        size: Option<PictureSize>,
        request: &Request,
        control: &mut Control,
    ) -> Result<Picture> {
        let scene = &self.scene;
        let mut seen = camera.cloned().unwrap_or_else(|| scene.first_camera());
        let (width, height, _) = PictureSize::of(size, &seen)?;
        if camera.is_none() && scene.cameras.is_empty() {
            seen = scene.camera_around(f64::from(width) / f64::from(height));
        }
        let mut settings = SceneSettings { keeps_parts: true, ..request.settings(None) };
        if request.has_no_end() {
            settings.stop.error = Some(GOOD_ERROR);
            settings.stop.seconds = Some(longest_seconds(gpus[0].facts().kind));
            settings.rounds = MOST_ROUNDS;
        }
        let (own, mut warnings) = self.geometry_of(&settings)?;
        let geometry = own.as_ref().unwrap_or(&self.geometry);
        warnings.extend(geometry.place_warning("the camera", [seen.eye]));
        let view = View { geometry, camera: Some(&seen), phases: &[] };
        let looking = Looking { view, sensor: Sensor::Picture { width, height }, point: "pixel" };
        let run = self.light(gpus, &looking, settings, Free::of(request), warnings, control)?;
        let scene_hash = scene_hash(geometry);
        Ok(Picture { run, scene: scene.clone(), camera: seen, size: (width, height), scene_hash })
    }

    /// The irradiance at points with the normals of their surfaces, metres.
    pub fn probe(&self, gpus: &mut Vec<Gpu>, points: &[(DVec3, DVec3)], request: &Request, control: &mut Control) -> Result<Run> {
        let allowed = format!("must be from 1 to {MAX_POINTS}, the number of points");
        require((1..=MAX_POINTS).contains(&points.len()), "--points", points.len(), allowed)?;
        let settings = request.settings(None);
        let with = match with_sensors(&self.scene, points, &settings) {
            Cow::Borrowed(_) => None,
            // Of its sheets nothing is to be said.
            Cow::Owned(scene) => Some(PreparedScene {
                geometry: Geometry::new(&scene)?,
                scene: Arc::new(scene),
                path: self.path.clone(),
                warnings: Vec::new(),
            }),
        };
        let this = with.as_ref().unwrap_or(self);
        let (own, mut warnings) = this.geometry_of(&settings)?;
        let geometry = own.as_ref().unwrap_or(&this.geometry);
        warnings.extend(geometry.place_warning("points", points.iter().map(|(position, _)| *position)));
        let target = Target::Points(points);
        let phases = target.phases(geometry);
        let looking = Looking { view: View { geometry, camera: None, phases: &phases }, sensor: target.sensor(), point: "point" };
        this.light(gpus, &looking, settings, Free { samples: false, ..Free::of(request) }, warnings, control)
    }

    /// Where the scene comes from.
    fn name(&self) -> &Path {
        self.path.as_deref().unwrap_or(Path::new(&self.scene.name))
    }

    /// The geometry that is left without some effects, and what is to be said of it; `None` where it is the scene's own. Refuses settings that
    /// are not allowed.
    fn geometry_of(&self, settings: &SceneSettings) -> Result<(Option<Geometry>, Vec<String>)> {
        settings.validate()?;
        if settings.without.is_empty() {
            return Ok((None, Vec::new()));
        }
        let geometry = Geometry::new(&self.scene.without(&settings.without))?;
        let warnings = geometry.warnings(&self.scene);
        Ok((Some(geometry), warnings))
    }

    /// Divides the work by a pilot, plans it with radii by a trial, and runs all rounds.
    fn light(
        &self,
        gpus: &mut Vec<Gpu>,
        looking: &Looking,
        settings: SceneSettings,
        free: Free,
        warnings: Vec<String>,
        control: &mut Control,
    ) -> Result<Run> {
        let (scene, &Looking { ref view, sensor, point }) = (&self.scene, looking);
        let started = Instant::now();
        let warnings = RefCell::new(warnings);
        let failed = |gpu: &Gpu, error: &Error, remedy| warnings.borrow_mut().push(in_words(gpu, error, remedy));
        let pilot =
            until_done(&mut gpus[0], &failed, |gpu| pilot::choose_for(gpu, scene, view, &settings, sensor, free, control.cancelled))?;
        let settings = pilot.as_ref().map_or_else(|| settings.clone(), |pilot| pilot.set(&settings));
        let settings = settings.in_whole_blocks(matches!(sensor, Sensor::Picture { .. }));
        if control.cancelled.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let plan = until_done(&mut gpus[0], &failed, |gpu| trial::plan(gpu, scene, view, &settings, sensor))?;
        warnings.borrow_mut().extend(scene_report::radius_warning(&plan, view.geometry, point));
        bias::check(&settings.stop, plan.film.bias)?;
        let result = light_on(gpus, (scene, view), &plan, None, &failed, control)?;
        let seconds = started.elapsed().as_secs_f64();
        Ok(Run { result, pilot, seconds, warnings: warnings.into_inner() })
    }
}
