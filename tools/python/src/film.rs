//! Results as arrays of numpy. An array is made once, when it is first asked for, and takes over the memory that the values were written to; as
//! all who ask share it, it cannot be written to.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use numpy::ndarray::{Array, Array2, Array3, Dimension};
use numpy::{IntoPyArray, PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use photonmill::output::colour::Format;
use photonmill::output::show::Surface;
use photonmill::render::{Image, Lightmaps as Baked, Observer};
use photonmill::settings::scene::Part;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict};

use crate::run::{Found, Run};
use crate::{error, settings};

/// An array that cannot be written to.
fn array<D: Dimension>(py: Python<'_>, values: Array<f32, D>) -> Bound<'_, PyArray<f32, D>> {
    let array = values.into_pyarray(py);
    drop(array.readwrite().make_nonwriteable());
    array
}

/// Colours of a picture's pixels.
fn picture((width, height): (u32, u32), colours: impl Iterator<Item = Vec3>) -> Array3<f32> {
    let mut values = Vec::with_capacity(3 * width as usize * height as usize);
    colours.for_each(|colour| values.extend(colour.to_array()));
    Array3::from_shape_vec((height as usize, width as usize, 3), values).expect("one colour a pixel")
}

fn rows(colours: impl Iterator<Item = Vec3>) -> Array2<f32> {
    let values: Vec<f32> = colours.flat_map(|colour| colour.to_array()).collect();
    Array2::from_shape_vec((values.len() / 3, 3), values).expect("three values a colour")
}

type Pixels = PyOnceLock<Py<PyArray3<f32>>>;

/// What each pixel sees first.
struct Surfaces {
    albedo: Py<PyArray3<f32>>,
    normal: Py<PyArray3<f32>>,
    depth: Py<PyArray2<f32>>,
}

#[doc = doc!("Film")]
#[pyclass(module = "photonmill", extends = Run, frozen)]
pub struct Film {
    found: Arc<Found>,
    radiance: Pixels,
    standard_error: Pixels,
    parts: PyOnceLock<Py<PyDict>>,
    surfaces: PyOnceLock<Surfaces>,
}

impl Film {
    pub fn new(py: Python<'_>, scene: &str, found: Image, warnings: Vec<String>) -> PyResult<Py<Film>> {
        let run = Run::new(py, scene, Found::Image(Box::new(found)), warnings)?;
        let found = run.found.clone();
        let film =
            Film { found, radiance: Pixels::new(), standard_error: Pixels::new(), parts: PyOnceLock::new(), surfaces: PyOnceLock::new() };
        Py::new(py, PyClassInitializer::from(run).add_subclass(film))
    }

    fn image(&self) -> &Image {
        match &*self.found {
            Found::Image(image) => image,
            _ => unreachable!("a film is of a picture"),
        }
    }

    fn surfaces(&self, py: Python<'_>) -> PyResult<&Surfaces> {
        self.surfaces.get_or_try_init(py, || {
            let made = self.image();
            let seen = py.detach(|| made.surfaces());
            let colours = |of: fn(&Surface) -> Vec3| array(py, picture(made.size, seen.iter().map(of))).unbind();
            let (width, height) = (made.size.0 as usize, made.size.1 as usize);
            let depths = seen.iter().map(|surface| surface.depth).collect();
            let depth = Array2::from_shape_vec((height, width), depths).expect("one depth a pixel");
            let (albedo, normal) = (colours(|surface| surface.albedo), colours(|surface| surface.normal));
            Ok(Surfaces { albedo, normal, depth: array(py, depth).unbind() })
        })
    }
}

#[pymethods]
impl Film {
    #[doc = doc!("Film.width")]
    #[getter]
    fn width(&self) -> u32 {
        self.image().size.0
    }

    #[doc = doc!("Film.height")]
    #[getter]
    fn height(&self) -> u32 {
        self.image().size.1
    }

    #[doc = doc!("Film.radiance")]
    #[getter]
    fn radiance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f32>> {
        let Image { run, size, .. } = self.image();
        let make = || array(py, py.detach(|| picture(*size, run.film.means().map(DVec3::as_vec3)))).unbind();
        self.radiance.get_or_init(py, make).bind(py).clone()
    }

    #[doc = doc!("Film.standard_error")]
    #[getter]
    fn standard_error<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f32>> {
        let Image { run, size, .. } = self.image();
        let errors = || {
            let of_pixel = run.film.stated_errors();
            picture(*size, (0..run.film.pixels()).map(|pixel| of_pixel(pixel).as_vec3()))
        };
        self.standard_error.get_or_init(py, || array(py, py.detach(errors)).unbind()).bind(py).clone()
    }

    #[doc = doc!("Film.unseen")]
    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let Image { run, size, .. } = self.image();
        let bounds: Vec<f32> = py.detach(|| (0..run.film.pixels()).map(run.film.unseen_bounds()).map(|most| most as f32).collect());
        array(py, Array2::from_shape_vec((size.1 as usize, size.0 as usize), bounds).expect("one bound a pixel"))
    }

    #[doc = doc!("Film.degrees_of_freedom")]
    #[getter]
    fn degrees_of_freedom(&self) -> u32 {
        self.image().run.film.error_freedom()
    }

    #[doc = doc!("Film.interval")]
    fn interval<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray3<f32>>; 2] {
        let Image { run, size, .. } = self.image();
        [0, 1].map(|end| {
            let ends = run.film.intervals();
            array(py, py.detach(|| picture(*size, (0..run.film.pixels()).map(|pixel| ends(pixel)[end].as_vec3()))))
        })
    }

    #[doc = doc!("Film.parts")]
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Image { run, size, .. } = self.image();
        let make = || {
            let parts = PyDict::new(py);
            let is_apart = run.film.mean_of_part(0, 0).is_some();
            for (number, part) in Part::EACH.into_iter().enumerate().filter(|_| is_apart) {
                let mean = |pixel: usize| run.film.mean_of_part(number, pixel).expect("parts are apart").as_vec3();
                let values = py.detach(|| picture(*size, (0..run.film.pixels()).map(mean)));
                parts.set_item(format!("{part:?}").to_lowercase(), array(py, values))?;
            }
            Ok::<_, PyErr>(parts.unbind())
        };
        // The arrays are shared, and the dict is the caller's own.
        self.parts.get_or_try_init(py, make)?.bind(py).copy()
    }

    #[doc = doc!("Film.albedo")]
    #[getter]
    fn albedo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        Ok(self.surfaces(py)?.albedo.bind(py).clone())
    }

    #[doc = doc!("Film.normal")]
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        Ok(self.surfaces(py)?.normal.bind(py).clone())
    }

    #[doc = doc!("Film.depth")]
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        Ok(self.surfaces(py)?.depth.bind(py).clone())
    }

    #[doc = doc!("Film.save")]
    #[pyo3(signature = (path, **style), text_signature = "($self, path, *, exposure=None, tone='neutral', white_balance=None, layers=None)")]
    fn save(&self, py: Python<'_>, path: PathBuf, style: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        let style = settings::style(py, &self.image().request, style, &["exposure", "tone", "white_balance", "layers"])?;
        py.detach(|| self.image().save_as(&path, &style, &Observer::default())).map_err(|failure| error::of(py, &failure))
    }

    #[doc = doc!("Film.png")]
    #[pyo3(signature = (**style), text_signature = "($self, *, exposure=None, tone='neutral', white_balance=None)")]
    fn png<'py>(&self, py: Python<'py>, style: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyBytes>> {
        let style = settings::style(py, &self.image().request, style, &["exposure", "tone", "white_balance"])?;
        Ok(PyBytes::new(py, &py.detach(|| self.image().file(&style, Format::Png, &Observer::default()).0)))
    }

    /// What a notebook shows.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.png(py, None)
    }
}

#[doc = doc!("Irradiance")]
#[pyclass(module = "photonmill", extends = Run, frozen)]
pub struct Irradiance {
    found: Arc<Found>,
    irradiance: PyOnceLock<Py<PyArray2<f32>>>,
    standard_error: PyOnceLock<Py<PyArray2<f32>>>,
}

impl Irradiance {
    pub fn new(py: Python<'_>, scene: &str, found: photonmill::render::Run, warnings: Vec<String>) -> PyResult<Py<Irradiance>> {
        let run = Run::new(py, scene, Found::Points(found), warnings)?;
        let found = run.found.clone();
        let points = Irradiance { found, irradiance: PyOnceLock::new(), standard_error: PyOnceLock::new() };
        Py::new(py, PyClassInitializer::from(run).add_subclass(points))
    }

    fn run(&self) -> &photonmill::render::Run {
        match &*self.found {
            Found::Points(run) => run,
            _ => unreachable!("irradiance is of points"),
        }
    }
}

#[pymethods]
impl Irradiance {
    #[doc = doc!("Irradiance.irradiance")]
    #[getter]
    fn irradiance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let make = || array(py, rows(self.run().film.means().map(DVec3::as_vec3))).unbind();
        self.irradiance.get_or_init(py, make).bind(py).clone()
    }

    #[doc = doc!("Irradiance.standard_error")]
    #[getter]
    fn standard_error<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let film = &self.run().film;
        let make = || {
            let of_point = film.stated_errors();
            array(py, rows((0..film.pixels()).map(|point| of_point(point).as_vec3()))).unbind()
        };
        self.standard_error.get_or_init(py, make).bind(py).clone()
    }

    #[doc = doc!("Irradiance.unseen")]
    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        let film = &self.run().film;
        let bounds: Vec<f32> = (0..film.pixels()).map(film.unseen_bounds()).map(|most| most as f32).collect();
        PyArray1::from_vec(py, bounds)
    }

    #[doc = doc!("Irradiance.degrees_of_freedom")]
    #[getter]
    fn degrees_of_freedom(&self) -> u32 {
        self.run().film.error_freedom()
    }

    #[doc = doc!("Irradiance.interval")]
    fn interval<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray2<f32>>; 2] {
        let film = &self.run().film;
        [0, 1].map(|end| {
            let ends = film.intervals();
            array(py, rows((0..film.pixels()).map(|point| ends(point)[end].as_vec3())))
        })
    }

    #[doc = doc!("Irradiance.__len__")]
    fn __len__(&self) -> usize {
        self.run().film.pixels()
    }
}

#[doc = doc!("Lightmap")]
#[pyclass(module = "photonmill", frozen)]
pub struct Lightmap {
    #[doc = doc!("Lightmap.name")]
    #[pyo3(get)]
    name: String,
    #[doc = doc!("Lightmap.irradiance")]
    #[pyo3(get)]
    irradiance: Py<PyArray3<f32>>,
    #[doc = doc!("Lightmap.standard_error")]
    #[pyo3(get)]
    standard_error: Py<PyArray3<f32>>,
    #[doc = doc!("Lightmap.unseen")]
    #[pyo3(get)]
    unseen: Py<PyArray2<f32>>,
    #[doc = doc!("Lightmap.degrees_of_freedom")]
    #[pyo3(get)]
    degrees_of_freedom: u32,
}

#[pymethods]
impl Lightmap {
    fn __repr__(&self, py: Python<'_>) -> String {
        let shape = numpy::PyUntypedArrayMethods::shape(self.irradiance.bind(py).as_untyped()).to_vec();
        format!("Lightmap('{}', {} x {})", self.name, shape[1], shape[0])
    }
}

#[doc = doc!("Lightmaps")]
#[pyclass(module = "photonmill", extends = Run, frozen)]
pub struct Lightmaps {
    found: Arc<Found>,
    maps: PyOnceLock<Vec<Py<Lightmap>>>,
}

impl Lightmaps {
    pub fn new(py: Python<'_>, scene: &str, baked: Baked, warnings: Vec<String>) -> PyResult<Py<Lightmaps>> {
        let run = Run::new(py, scene, Found::Lightmaps(baked), warnings)?;
        let found = run.found.clone();
        Py::new(py, PyClassInitializer::from(run).add_subclass(Lightmaps { found, maps: PyOnceLock::new() }))
    }

    fn baked(&self) -> &Baked {
        match &*self.found {
            Found::Lightmaps(baked) => baked,
            _ => unreachable!("lightmaps are of a bake"),
        }
    }

    fn maps(&self, py: Python<'_>) -> PyResult<&Vec<Py<Lightmap>>> {
        self.maps.get_or_try_init(py, || {
            let map = |map: &photonmill::render::Lightmap| {
                let values = |colours: &[Vec3]| array(py, picture((map.width, map.height), colours.iter().copied())).unbind();
                let (irradiance, standard_error) = (values(&map.irradiance), values(&map.standard_error));
                let unseen = Array2::from_shape_vec((map.height as usize, map.width as usize), map.unseen.clone());
                let unseen = array(py, unseen.expect("one bound a texel")).unbind();
                let degrees_of_freedom = map.source.degrees_of_freedom;
                Py::new(py, Lightmap { name: map.name.clone(), irradiance, standard_error, unseen, degrees_of_freedom })
            };
            self.baked().maps.iter().map(map).collect()
        })
    }
}

#[pymethods]
impl Lightmaps {
    #[doc = doc!("Lightmaps.maps")]
    #[getter]
    #[pyo3(name = "maps")]
    fn list(&self, py: Python<'_>) -> PyResult<Vec<Py<Lightmap>>> {
        Ok(self.maps(py)?.iter().map(|map| map.clone_ref(py)).collect())
    }

    #[doc = doc!("Lightmaps.files")]
    #[getter]
    fn files(&self) -> Vec<String> {
        self.baked().files.clone()
    }

    #[doc = doc!("Lightmaps.__len__")]
    fn __len__(&self) -> usize {
        self.baked().maps.len()
    }
}
