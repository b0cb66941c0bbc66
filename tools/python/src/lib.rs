//! photonmill as a Python module: classes around what `photonmill::render` and `photonmill::measure::study` do. What each is for stands in
//! `photonmill.pyi`, which is the reference.

// Docstrings by name, from `photonmill.pyi`.
include!(concat!(env!("OUT_DIR"), "/doc.rs"));

mod camera;
mod device;
mod error;
mod film;
mod run;
mod scene;
mod settings;
mod study;

use pyo3::prelude::*;

#[doc = doc!("")]
#[pymodule]
#[pyo3(name = "photonmill")]
fn photonmill_module(module: &Bound<'_, PyModule>) -> PyResult<()> {
    error::add_to(module)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<device::DeviceFacts>()?;
    module.add_class::<device::Device>()?;
    module.add_class::<camera::Camera>()?;
    module.add_class::<scene::Light>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<run::Run>()?;
    module.add_class::<film::Film>()?;
    module.add_class::<film::Irradiance>()?;
    module.add_class::<film::Lightmap>()?;
    module.add_class::<film::Lightmaps>()?;
    module.add_function(wrap_pyfunction!(device::devices, module)?)?;
    module.add_function(wrap_pyfunction!(scene::scenes, module)?)?;
    module.add_function(wrap_pyfunction!(study::study, module)?)
}
