//! Scenes, and what is computed of them.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyReadonlyArray2;
use photonmill::bake::MAX_SIDE;
use photonmill::bake::pages::{Atlas, MIN_PAGE};
use photonmill::gpu::Gpu;
use photonmill::output::destination::Folder;
use photonmill::render::options::Command;
use photonmill::render::points::point_of;
use photonmill::render::values::SunPosition;
use photonmill::render::{BakeRequest, Event, Observer, PreparedScene, RenderRequest};
use photonmill::scene::image_size::{ImageSize, parse_size};
use photonmill::scene::surroundings::Environment;
use photonmill::scene::{LightKind, built_in};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::camera::Camera;
use crate::device::{Device, or_usual};
use crate::error;
use crate::film::{Film, Irradiance, Lightmaps};
use crate::run::{beside_python, on_devices};
use crate::settings;

#[doc = doc!("Light")]
#[pyclass(module = "photonmill", frozen)]
pub struct Light {
    #[doc = doc!("Light.name")]
    #[pyo3(get)]
    name: String,
    #[doc = doc!("Light.kind")]
    #[pyo3(get)]
    kind: &'static str,
}

#[pymethods]
impl Light {
    fn __repr__(&self) -> String {
        format!("Light('{}', {})", self.name, self.kind)
    }
}

#[doc = doc!("Scene")]
#[pyclass(module = "photonmill", frozen)]
pub struct Scene {
    scene: Arc<PreparedScene>,
    warnings: Vec<String>,
    /// As it was named.
    pub named: String,
}

/// The name of a folder or a file, or a name.
fn path_of(value: &Bound<'_, PyAny>, name: &str) -> PyResult<String> {
    let path: PathBuf =
        value.extract().map_err(|_| PyTypeError::new_err(format!("{name} must be a str or a path, not {}", value.get_type())))?;
    path.into_os_string().into_string().map_err(|_| PyTypeError::new_err(format!("{name} must be in UTF-8")))
}

fn environment_of(value: &Bound<'_, PyAny>) -> PyResult<Environment> {
    let py = value.py();
    let colour = value.extract::<f32>().map(|grey| [grey; 3]).or_else(|_| value.extract::<[f32; 3]>());
    match colour {
        Ok(colour) if colour.iter().all(|value| value.is_finite() && *value >= 0.0) => Ok(Environment::Colour(colour)),
        Ok(_) => Err(error::argument(py, format!("environment={}: must be 0 or more and finite", value.repr()?))),
        Err(_) => {
            let wrong = |_| PyTypeError::new_err("environment must be a number, three numbers, or the path of an .hdr or .exr");
            path_of(value, "environment").map(PathBuf::from).map(Environment::Image).map_err(wrong)
        }
    }
}

/// A width, or a width and a height, in pixels.
fn size_of(value: &Bound<'_, PyAny>) -> PyResult<ImageSize> {
    let py = value.py();
    let text = match (value.extract::<i64>(), value.extract::<[i64; 2]>()) {
        (Ok(width), _) => width.to_string(),
        (_, Ok([width, height])) => format!("{width}x{height}"),
        _ => return Err(PyTypeError::new_err("size must be a width or (width, height), whole numbers of pixels")),
    };
    parse_size(&text).map_err(|allowed| error::argument(py, format!("size={text}: {allowed}")))
}

/// The points of a call: arrays of shape (n, 3).
fn points_of(points: &Bound<'_, PyAny>, normals: &Bound<'_, PyAny>) -> PyResult<Vec<(glam::DVec3, glam::DVec3)>> {
    let py = points.py();
    let numpy = py.import("numpy")?;
    let table = |value: &Bound<'_, PyAny>, name: &str| -> PyResult<Vec<[f64; 3]>> {
        let keywords = PyDict::new(py);
        keywords.set_item("dtype", "float64")?;
        // What is an array of doubles already is not copied.
        let array = numpy.call_method("asarray", (value,), Some(&keywords))?;
        let shape: Vec<usize> = array.getattr("shape")?.extract()?;
        let [_, 3] = shape[..] else {
            return Err(error::argument(py, format!("{name}: must have the shape (n, 3), and has {}", array.getattr("shape")?)));
        };
        let array: PyReadonlyArray2<'_, f64> = array.extract()?;
        Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
    };
    let (points, normals) = (table(points, "points")?, table(normals, "normals")?);
    if points.len() != normals.len() {
        let counts = format!("normals: there are {} of them, and {} points; each point needs one", normals.len(), points.len());
        return Err(error::argument(py, counts));
    }
    let all = points.into_iter().zip(normals).enumerate();
    let point = |(number, (position, normal))| {
        point_of(position, normal).map_err(|fault| error::argument(py, format!("points: number {number} {fault}")))
    };
    all.map(point).collect()
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (scene, *, radiometric=false, at=None, environment=None, sun=None, environment_rotate=None, environment_strength=None))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, PyAny>,
        radiometric: bool,
        at: Option<f64>,
        environment: Option<&Bound<'_, PyAny>>,
        sun: Option<[f64; 2]>,
        environment_rotate: Option<f64>,
        environment_strength: Option<f32>,
    ) -> PyResult<Scene> {
        let name = path_of(scene, "scene")?;
        let environment = environment.map(environment_of).transpose()?;
        if let Some([azimuth, elevation]) =
            sun.filter(|[azimuth, elevation]| !(azimuth.is_finite() && *elevation > 0.0 && *elevation <= 90.0))
        {
            let allowed = "must be azimuth and elevation in degrees; the elevation above 0 and at most 90";
            return Err(error::argument(py, format!("sun=({azimuth}, {elevation}): {allowed}")));
        }
        let sun = sun.map(|[azimuth, elevation]| SunPosition { azimuth, elevation });
        let request = RenderRequest {
            radiometric,
            at,
            environment,
            sun,
            environment_rotate,
            environment_strength,
            ..RenderRequest::of(name.clone())
        };
        let (scene, warnings) = beside_python(py, &|_, ()| Ok(()), |cancelled, _| {
            let warnings = RefCell::new(Vec::new());
            let report = |event: Event| {
                if let Event::Warning(text) | Event::Remark(text) = event {
                    warnings.borrow_mut().push(text.to_owned());
                }
            };
            let observer = Observer { cancelled, report: &report };
            let scene = PreparedScene::read(&request, &observer)?;
            scene.make_geometry(&observer)?;
            Ok((scene, warnings.take()))
        })?;
        error::warn(py, &warnings)?;
        Ok(Scene { scene: Arc::new(scene), warnings, named: name })
    }

    #[doc = doc!("Scene.name")]
    #[getter]
    fn name(&self) -> &str {
        &self.scene.scene.name
    }

    #[doc = doc!("Scene.cameras")]
    #[getter]
    fn cameras(&self) -> Vec<Camera> {
        self.scene.scene.cameras.iter().map(|camera| Camera { camera: camera.clone() }).collect()
    }

    #[doc = doc!("Scene.lights")]
    #[getter]
    fn lights(&self) -> Vec<Light> {
        let kind = |kind: &LightKind| match kind {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Directional { .. } => "directional",
            LightKind::Disc { .. } => "disc",
            LightKind::Environment { .. } => "environment",
            LightKind::Sky(_) => "sky",
        };
        self.scene.scene.lights.iter().map(|light| Light { name: error::in_python(&light.name), kind: kind(&light.kind) }).collect()
    }

    #[doc = doc!("Scene.materials")]
    #[getter]
    fn materials(&self) -> Vec<String> {
        self.scene.scene.materials.iter().map(|material| material.name.clone()).collect()
    }

    #[doc = doc!("Scene.meshes")]
    #[getter]
    fn meshes(&self) -> Vec<String> {
        self.scene.scene.meshes.iter().map(|mesh| mesh.name.clone()).collect()
    }

    #[doc = doc!("Scene.triangles")]
    #[getter]
    fn triangles(&self) -> usize {
        self.scene.scene.triangle_count()
    }

    #[doc = doc!("Scene.bounds")]
    #[getter]
    fn bounds(&self) -> ((f64, f64, f64), (f64, f64, f64)) {
        let (least, most) = self.scene.scene.bounds();
        (least.into(), most.into())
    }

    #[doc = doc!("Scene.warnings")]
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.iter().map(|line| error::in_python(line)).collect()
    }

    #[doc = doc!("Scene.render")]
    #[pyo3(signature = (camera=None, size=None, *, device=None, progress=None, **settings))]
    fn render(
        &self,
        py: Python<'_>,
        camera: Option<&Bound<'_, PyAny>>,
        size: Option<&Bound<'_, PyAny>>,
        device: Option<Py<Device>>,
        progress: Option<&Bound<'_, PyAny>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<Film>> {
        let size = size.map(size_of).transpose()?;
        let request = RenderRequest { size, ..settings::request(py, settings, Command::Render)? };
        let (request, camera) = camera.map_or(Ok((request.clone(), None)), |camera| self.camera(camera, &request))?;
        let device = or_usual(py, device)?;
        let (image, warnings) =
            on_devices(py, &device.get().gpus, progress, |gpus, observer| self.scene.render(gpus, camera.as_ref(), &request, observer))?;
        Film::new(py, self.name(), image, warnings)
    }

    #[doc = doc!("Scene.probe")]
    #[pyo3(signature = (points, normals, *, device=None, progress=None, **settings))]
    fn probe(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        normals: &Bound<'_, PyAny>,
        device: Option<Py<Device>>,
        progress: Option<&Bound<'_, PyAny>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<Irradiance>> {
        let request = settings::request(py, settings, Command::Probe)?;
        let points = points_of(points, normals)?;
        let device = or_usual(py, device)?;
        let work = |gpus: &mut Vec<Gpu>, observer: &Observer| self.scene.probe(gpus, &points, &request, observer);
        let (run, warnings) = on_devices(py, &device.get().gpus, progress, work)?;
        Irradiance::new(py, self.name(), run, warnings)
    }

    #[doc = doc!("Scene.bake")]
    #[pyo3(signature = (folder=None, *, texels_per_metre=None, atlas=None, preview=false, exposure=None, device=None, progress=None, **settings))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn bake(
        &self,
        py: Python<'_>,
        folder: Option<PathBuf>,
        texels_per_metre: Option<f64>,
        atlas: Option<&Bound<'_, PyAny>>,
        preview: bool,
        exposure: Option<f32>,
        device: Option<Py<Device>>,
        progress: Option<&Bound<'_, PyAny>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<Lightmaps>> {
        let request = settings::request(py, settings, Command::Bake)?;
        let folder = folder.map(|path| Folder::open("folder", &path)).transpose().map_err(|failure| error::of(py, &failure))?;
        let atlas = atlas.map(atlas_of).transpose()?;
        let bake = BakeRequest { texels_per_metre, folder, atlas, preview, exposure };
        let device = or_usual(py, device)?;
        let work = |gpus: &mut Vec<Gpu>, observer: &Observer| self.scene.bake(gpus, &bake, &request, observer);
        let (baked, warnings) = on_devices(py, &device.get().gpus, progress, work)?;
        Lightmaps::new(py, self.name(), baked, warnings)
    }

    fn __repr__(&self) -> String {
        format!("Scene('{}', {} triangles)", self.name(), self.triangles())
    }
}

impl Scene {
    /// A request with one of the scene's cameras by name, or one's own camera beside it.
    fn camera(&self, camera: &Bound<'_, PyAny>, request: &RenderRequest) -> PyResult<(RenderRequest, Option<photonmill::scene::Camera>)> {
        if let Ok(camera) = camera.cast::<Camera>() {
            return Ok((request.clone(), Some(camera.get().camera.clone())));
        }
        let wrong = |_| PyTypeError::new_err(format!("camera must be a Camera or the name of one, not {}", camera.get_type()));
        let name: String = camera.extract().map_err(wrong)?;
        self.scene.scene.camera(&name).map_err(|failure| error::of(camera.py(), &failure))?;
        Ok((RenderRequest { camera: Some(name), ..request.clone() }, None))
    }
}

fn atlas_of(value: &Bound<'_, PyAny>) -> PyResult<Atlas> {
    let size = value.extract::<u32>().ok().filter(|size| (MIN_PAGE..=MAX_SIDE).contains(size)).map(Atlas::Size);
    let off = value.extract::<String>().ok().filter(|text| text == "off").map(|_| Atlas::Off);
    let allowed = || format!("atlas={value}: must be a size in texels from {MIN_PAGE} to {MAX_SIDE}, or 'off'");
    size.or(off).ok_or_else(|| error::argument(value.py(), allowed()))
}

#[doc = doc!("scenes")]
#[pyfunction]
pub fn scenes() -> Vec<&'static str> {
    built_in::names()
}
