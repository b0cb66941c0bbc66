//! Devices: what there is, and one that is open.

use std::sync::{Arc, Mutex};

use photonmill::gpu::{self, Gpu, Options};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use crate::error;

#[doc = doc!("DeviceFacts")]
#[pyclass(module = "photonmill", subclass, frozen)]
pub struct DeviceFacts {
    pub facts: gpu::DeviceFacts,
}

#[doc = doc!("Device")]
#[pyclass(module = "photonmill", extends = DeviceFacts, frozen)]
pub struct Device {
    pub gpus: Arc<Mutex<Vec<Gpu>>>,
}

#[pymethods]
impl DeviceFacts {
    #[doc = doc!("DeviceFacts.index")]
    #[getter]
    fn index(&self) -> usize {
        self.facts.index
    }

    #[doc = doc!("DeviceFacts.name")]
    #[getter]
    fn name(&self) -> &str {
        &self.facts.name
    }

    #[doc = doc!("DeviceFacts.kind")]
    #[getter]
    fn kind(&self) -> &str {
        self.facts.kind
    }

    #[doc = doc!("DeviceFacts.driver")]
    #[getter]
    fn driver(&self) -> &str {
        &self.facts.driver
    }

    #[doc = doc!("DeviceFacts.vulkan")]
    #[getter]
    fn vulkan(&self) -> &str {
        &self.facts.vulkan
    }

    #[doc = doc!("DeviceFacts.memory")]
    #[getter]
    fn memory(&self) -> u64 {
        self.facts.device_memory_bytes
    }

    #[doc = doc!("DeviceFacts.subgroup_size")]
    #[getter]
    fn subgroup_size(&self) -> u32 {
        self.facts.subgroup_size
    }

    #[doc = doc!("DeviceFacts.lacks")]
    #[getter]
    fn lacks(&self) -> Vec<String> {
        self.facts.lacks.clone()
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let facts = &slf.get().facts;
        Ok(format!("{}({}, '{}', {})", slf.get_type().name()?, facts.index, facts.name, facts.kind))
    }
}

#[pymethods]
impl Device {
    #[new]
    #[pyo3(signature = (name=None, *, memory=None, validate=false))]
    fn new(py: Python<'_>, name: Option<&Bound<'_, PyAny>>, memory: Option<u64>, validate: bool) -> PyResult<PyClassInitializer<Device>> {
        let device = name.map(name_of).transpose()?;
        if let Some(memory) = memory.filter(|memory| *memory < gpu::LEAST_MEMORY) {
            return Err(error::argument(py, format!("memory={memory}: must be at least {} (bytes)", gpu::LEAST_MEMORY)));
        }
        open(py, Options { device, memory, validate, ..Options::default() })
    }
}

/// Its number or a part of its name.
fn name_of(name: &Bound<'_, PyAny>) -> PyResult<String> {
    let number = || name.extract::<i64>().map(|number| number.to_string());
    let wrong = |_| PyTypeError::new_err(format!("name must be a str or an int, not {}", name.get_type()));
    name.extract::<String>().or_else(|_| number()).map_err(wrong)
}

fn open(py: Python<'_>, options: Options) -> PyResult<PyClassInitializer<Device>> {
    let gpu = py.detach(|| Gpu::open(&options)).map_err(|failure| error::of(py, &failure))?;
    let facts = DeviceFacts { facts: gpu.facts().clone() };
    Ok(PyClassInitializer::from(facts).add_subclass(Device { gpus: Arc::new(Mutex::new(vec![gpu])) }))
}

/// The device that is meant, or the usual one, which is opened once.
pub fn or_usual(py: Python<'_>, device: Option<Py<Device>>) -> PyResult<Py<Device>> {
    static USUAL: PyOnceLock<Py<Device>> = PyOnceLock::new();
    match device {
        Some(device) => Ok(device),
        None => USUAL.get_or_try_init(py, || Py::new(py, open(py, Options::default())?)).map(|device| device.clone_ref(py)),
    }
}

#[doc = doc!("devices")]
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<DeviceFacts>> {
    let all = py.detach(Gpu::list).map_err(|failure| error::of(py, &failure))?;
    Ok(all.into_iter().map(|facts| DeviceFacts { facts }).collect())
}
