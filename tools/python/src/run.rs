//! Runs beside Python: on a thread of their own, so that other threads of Python go on, Ctrl-C is heard and progress is reported. And what all
//! results have in common.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

use photonmill::engine::End;
use photonmill::engine::run::watch::Progress;
use photonmill::error::{Error as Failure, Result};
use photonmill::gpu::Gpu;
use photonmill::output::scene_report;
use photonmill::render::{self, Event, Image, Lightmaps, Observer};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error;

/// Between two looks for Ctrl-C.
const INTERVAL: Duration = Duration::from_millis(50);

/// Does `work` on another thread, which reports what it calls `Reported` on the way, and calls `report` with the latest of it. What Ctrl-C or `report`
/// raises ends the work early.
pub fn beside_python<T: Send, Reported: Send>(
    py: Python<'_>,
    report: &dyn Fn(Python<'_>, Reported) -> PyResult<()>,
    work: impl FnOnce(&AtomicBool, &mut dyn FnMut(Reported)) -> Result<T> + Send,
) -> PyResult<T> {
    let cancelled = AtomicBool::new(false);
    let (sender, receiver) = channel();
    // A lock, as it is handed to where Python is not.
    let receiver = Mutex::new(receiver);
    let wait = || {
        let receiver = receiver.lock().unwrap_or_else(PoisonError::into_inner);
        let reported = receiver.recv_timeout(INTERVAL);
        receiver.try_iter().last().map_or(reported, Ok)
    };
    let mut raised = None;
    let cancelled = &cancelled;
    let done = std::thread::scope(|scope| {
        // Nobody may listen any more.
        let worker = scope.spawn(move || work(cancelled, &mut |reported| drop(sender.send(reported))));
        loop {
            let reported = match py.detach(wait) {
                Err(RecvTimeoutError::Disconnected) => break,
                reported => reported.ok(),
            };
            if raised.is_none() {
                raised = py.check_signals().and_then(|()| reported.map_or(Ok(()), |reported| report(py, reported))).err();
                cancelled.store(raised.is_some(), Ordering::Relaxed);
            }
        }
        worker.join()
    });
    match (raised, done) {
        (Some(raised), _) => Err(raised),
        (None, Ok(Ok(done))) => Ok(done),
        (None, Ok(Err(Failure::Interrupted))) => Err(PyKeyboardInterrupt::new_err(())),
        (None, Ok(Err(failure))) => Err(error::of(py, &failure)),
        (None, Err(panic)) => std::panic::resume_unwind(panic),
    }
}

/// The devices, as soon as no other thread uses them.
fn lock<'a>(gpus: &'a Mutex<Vec<Gpu>>, cancelled: &AtomicBool) -> Result<MutexGuard<'a, Vec<Gpu>>> {
    loop {
        match gpus.try_lock() {
            Ok(gpus) => return Ok(gpus),
            Err(TryLockError::Poisoned(gpus)) => return Ok(gpus.into_inner()),
            Err(TryLockError::WouldBlock) if cancelled.load(Ordering::Relaxed) => return Err(Failure::Interrupted),
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// Does `work` on devices, and calls `progress` with how far it has come; returns the warnings of the work, too.
pub fn on_devices<T: Send>(
    py: Python<'_>,
    gpus: &Mutex<Vec<Gpu>>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&mut Vec<Gpu>, &Observer) -> Result<T> + Send,
) -> PyResult<(T, Vec<String>)> {
    let progress = progress.map(|progress| progress.clone().unbind());
    let report = |py: Python<'_>, reported: Progress| match &progress {
        Some(progress) => progress.call1(py, (progress_dict(py, &reported)?,)).map(drop),
        None => Ok(()),
    };
    beside_python(py, &report, |cancelled, report| {
        let (warnings, report) = (RefCell::new(Vec::new()), RefCell::new(report));
        let event = |event: Event| match event {
            Event::Progress(progress, _) => (report.borrow_mut())(progress.clone()),
            Event::Warning(text) | Event::Remark(text) => warnings.borrow_mut().push(text.to_owned()),
            _ => {}
        };
        let done = work(&mut *lock(gpus, cancelled)?, &Observer { cancelled, report: &event })?;
        Ok((done, warnings.into_inner()))
    })
}

fn progress_dict<'py>(py: Python<'py>, progress: &Progress) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("rounds", progress.done)?;
    dict.set_item("seconds", progress.seconds)?;
    dict.set_item("seconds_left", progress.seconds_left)?;
    dict.set_item("error", progress.error)?;
    dict.set_item("photons", progress.photons)?;
    Ok(dict)
}

/// What a call has found.
pub enum Found {
    Image(Box<Image>),
    Points(render::Run),
    Lightmaps(Lightmaps),
}

#[doc = doc!("Run")]
#[pyclass(module = "photonmill", subclass, frozen)]
pub struct Run {
    pub found: Arc<Found>,
    scene: String,
    warnings: Vec<String>,
}

impl Run {
    /// Issues the warnings of a run.
    pub fn new(py: Python<'_>, scene: &str, found: Found, warnings: Vec<String>) -> PyResult<Run> {
        error::warn(py, &warnings)?;
        Ok(Run { found: Arc::new(found), scene: scene.to_owned(), warnings })
    }

    fn run(&self) -> &render::Run {
        match &*self.found {
            Found::Image(image) => &image.run,
            Found::Points(run) => run,
            Found::Lightmaps(lightmaps) => &lightmaps.run,
        }
    }
}

#[pymethods]
impl Run {
    #[doc = doc!("Run.relative_error")]
    #[getter]
    fn relative_error(&self) -> f64 {
        self.run().error().noise
    }

    #[doc = doc!("Run.bound")]
    #[getter]
    fn bound(&self) -> f64 {
        let run = self.run();
        run.error().bound_of_all(run.plan.settings.stop.confidence, run.losses.relative)
    }

    #[doc = doc!("Run.bias")]
    #[getter]
    fn bias(&self) -> Option<f64> {
        self.run().error().bias.map(|bias| bias.relative)
    }

    #[doc = doc!("Run.confidence")]
    #[getter]
    fn confidence(&self) -> f64 {
        self.run().plan.settings.stop.confidence
    }

    #[doc = doc!("Run.rounds")]
    #[getter]
    fn rounds(&self) -> u32 {
        self.run().film.rounds
    }

    #[doc = doc!("Run.seconds")]
    #[getter]
    fn seconds(&self) -> f64 {
        self.run().seconds
    }

    #[doc = doc!("Run.end")]
    #[getter]
    fn end(&self) -> &'static str {
        match self.run().end {
            End::Rounds => "rounds",
            End::Error => "error",
            End::Time => "time",
            End::Photons => "photons",
            End::Cancelled => "cancelled",
        }
    }

    #[doc = doc!("Run.seed")]
    #[getter]
    fn seed(&self) -> u64 {
        self.run().plan.settings.seed
    }

    #[doc = doc!("Run.ledger")]
    #[getter]
    fn ledger<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let ledger = self.run().ledger();
        let dict = PyDict::new(py);
        let counts = [
            ("emitted", ledger.emitted),
            ("absorbed", ledger.absorbed),
            ("escaped", ledger.escaped),
            ("cut_off", ledger.cut_off),
            ("dropped", ledger.dropped),
            ("stored", ledger.stored),
        ];
        counts.into_iter().try_for_each(|(name, count)| dict.set_item(name, count))?;
        Ok(dict)
    }

    #[doc = doc!("Run.warnings")]
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.iter().map(|line| error::in_python(line)).collect()
    }

    #[doc = doc!("Run.report")]
    #[getter]
    fn report(&self) -> String {
        let point = match &*self.found {
            Found::Image(_) => "pixel",
            Found::Points(_) => "point",
            Found::Lightmaps(_) => "texel",
        };
        error::in_python(&scene_report::text(&self.scene, self.run(), point, false))
    }

    #[doc = doc!("Run.details")]
    #[getter]
    fn details<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let json = scene_report::json(&self.scene, self.run());
        py.import("json")?.call_method1("loads", (String::from_utf8_lossy(&json),))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let run = slf.get();
        let (error, seconds) = (100.0 * run.relative_error(), run.seconds());
        Ok(format!("{}('{}', {} rounds, {error:.2} % relative error, {seconds:.2} s)", slf.get_type().name()?, run.scene, run.rounds()))
    }
}
