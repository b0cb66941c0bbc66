//! What accuracy costs in time.

use std::path::PathBuf;

use photonmill::error::{Error as Failure, Result};
use photonmill::gpu::{Gpu, Options};
use photonmill::measure::study::{self as studies, Study, StudyRequest};
use photonmill::output::destination::Folder;
use photonmill::scene;
use pyo3::prelude::*;

use crate::device::Device;
use crate::run::beside_python;

#[doc = doc!("study")]
#[pyfunction]
#[pyo3(signature = (scene, folder, *, budget=240.0, repeats=5, side=None, photons=None, rounds=1_048_576, seed=1, reference_samples=4096, device=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "they have names in Python")]
pub fn study<'py>(
    py: Python<'py>,
    scene: PathBuf,
    folder: PathBuf,
    budget: f64,
    repeats: u32,
    side: Option<u32>,
    photons: Option<u32>,
    rounds: u32,
    seed: u64,
    reference_samples: u32,
    device: Option<Py<Device>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let wanted = device.map(|device| device.bind(py).as_super().get().facts.index.to_string());
    let progress = progress.map(|progress| progress.clone().unbind());
    let report = |py: Python<'_>, line: String| progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (line,)).map(drop));
    let json = beside_python(py, &report, |cancelled, report| -> Result<Vec<u8>> {
        let folder = Folder::open("-o", &folder)?;
        let budget = studies::budget(budget)?;
        let name = scene.to_string_lossy().into_owned();
        let request = |is_cpu: bool| {
            let usual = StudyRequest::usual(&name, is_cpu);
            let (size, photons) = (side.unwrap_or(usual.size), photons.unwrap_or(usual.photons));
            StudyRequest { size, photons, repeats, seed, reference_samples, budget, most_rounds: rounds, ..usual }
        };
        request(true).validate()?;
        let scene = scene::Scene::open(&name, false)?;
        let gpu = Gpu::open(&Options { device: wanted, warm_up: true, ..Options::default() })?;
        let request = request(gpu.facts().kind == "cpu");
        let found: Study = studies::run(&gpu, &scene, request, &folder, cancelled, &mut |line| report(line.to_owned()))?;
        studies::write(&folder, &found)?;
        // The same call goes on with what is there.
        if !found.complete { Err(Failure::Interrupted) } else { Ok(serde_json::to_vec(&found).expect("a study is plain data")) }
    })?;
    py.import("json")?.call_method1("loads", (String::from_utf8_lossy(&json),))
}
