//! What accuracy costs in time: every choice that a user has, measured as error against time on this device.
//!
//! A study runs each configuration of each axis ([`axes`]) at numbers of rounds that double, several times with seeds of
//! their own, holds the results against a reference that another method made ([`reference`]), and writes what it found
//! as a page, CSV, JSON and SVG. Points that are finished are kept ([`store`]), so that a study that was cut off goes on
//! where it ended.

pub mod axes;
pub mod chart;
pub mod findings;
pub mod page;
pub mod point;
pub mod reference;
pub mod store;
pub mod subject;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::destination::{Folder, write_all};
use crate::scene::Scene;
use axes::Configuration;
use point::{Curve, Point};
use store::Store;
use subject::Subject;

/// What is asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Request {
    /// As the user names it.
    pub scene: String,
    /// Pixels along each side of the picture, or texels along each wall of the paper's box.
    pub size: u32,
    /// Photons of a round, from which the axis of photons goes up and down.
    pub photons: u32,
    /// Runs of every point, each with a seed of its own.
    pub repeats: u32,
    pub seed: u64,
    /// Samples a pixel of a path-traced reference.
    pub reference_samples: u32,
    /// Wall time of all measurements together, shared out evenly; not of the reference.
    #[serde(skip)]
    pub budget: Duration,
}

/// Everything that was found.
#[derive(Debug, Serialize)]
pub struct Study {
    pub photonmill: &'static str,
    pub request: Request,
    pub device: String,
    pub driver: String,
    /// A software device, whose 'GPU' is the CPU.
    pub is_cpu: bool,
    pub parts: Vec<Part>,
    /// False if it was ended before its last point.
    pub complete: bool,
}

/// One quantity and everything that was measured of it.
#[derive(Debug, Serialize)]
pub struct Part {
    pub quantity: String,
    /// Where the reference comes from and how well it is known.
    pub reference: String,
    /// Root mean square of the reference's own error over its root mean square.
    pub reference_error: f64,
    pub curves: Vec<Curve>,
}

/// Runs a study, and tells a line for each configuration.
pub fn run(
    gpu: &Gpu,
    scene: &Scene,
    request: Request,
    folder: &Folder,
    cancelled: &AtomicBool,
    tell: &mut dyn FnMut(&str),
) -> Result<Study> {
    let mut store = Store::open(folder, &request, gpu.facts())?;
    let mut study = Study {
        photonmill: env!("CARGO_PKG_VERSION"),
        device: gpu.facts().name.clone(),
        driver: gpu.facts().driver.clone(),
        is_cpu: gpu.facts().kind == "cpu",
        parts: Vec::new(),
        complete: false,
        request,
    };
    let subjects = Subject::all(gpu, scene, &study.request, tell)?;
    for points in subjects.iter().filter_map(Subject::points_file).take(1) {
        write_all([(folder.file(subject::POINTS), points.into_bytes())])?;
    }
    let count: usize = subjects.iter().map(|subject| subject.configurations.len()).sum();
    let share = study.request.budget / count.max(1) as u32;
    let mut begun = 0;
    for subject in &subjects {
        study.parts.push(Part {
            quantity: subject.quantity.clone(),
            reference: subject.reference.method.clone(),
            reference_error: subject.reference.relative_error,
            curves: Vec::new(),
        });
        for configuration in &subject.configurations {
            begun += 1;
            let Configuration { axis, label, .. } = configuration;
            tell(&format!("[{begun}/{count}] {}: {}: {label}", subject.quantity, axis.name()));
            let (curve, whole) = measure(gpu, subject, configuration, &study.request, share, cancelled, &mut store)?;
            study.parts.last_mut().expect("pushed above").curves.push(curve);
            if !whole {
                return Ok(study);
            }
        }
    }
    study.complete = true;
    Ok(study)
}

/// Points of one configuration at numbers of rounds that double until its share of time is spent, and whether nobody
/// ended it before.
fn measure(
    gpu: &Gpu,
    subject: &Subject,
    configuration: &Configuration,
    request: &Request,
    share: Duration,
    cancelled: &AtomicBool,
    store: &mut Store,
) -> Result<(Curve, bool)> {
    let mut points: Vec<Point> = Vec::new();
    let (mut spent, mut warm) = (Duration::ZERO, false);
    let mut whole = true;
    for doublings in 0..20 {
        let rounds = 1 << doublings;
        if rounds > configuration.most_rounds() {
            break;
        }
        let command = subject.command(configuration, rounds, request.seed);
        if let Some(known) = store.find(&command) {
            spent += known.spent();
            points.push(known);
            continue;
        }
        // Twice the photons take at most twice the time.
        let next = points.last().map_or(Duration::ZERO, |last| 2 * last.spent());
        if spent + next > share {
            break;
        }
        if !warm {
            // Pipelines are made, and a card that idled comes to its clock.
            subject.run(gpu, configuration, 1, request.seed, cancelled)?;
            warm = true;
        }
        let mut shots = Vec::new();
        for repeat in 0..u64::from(request.repeats) {
            let began = Instant::now();
            let Some(shot) = subject.run(gpu, configuration, rounds, request.seed + repeat, cancelled)? else { break };
            shots.push((shot, began.elapsed()));
        }
        if shots.len() < request.repeats as usize {
            whole = false;
            break;
        }
        let point = Point::of(&shots, &subject.reference, command, rounds);
        spent += point.spent();
        store.keep(&point)?;
        points.push(point);
        if cancelled.load(Ordering::Relaxed) {
            whole = false;
            break;
        }
    }
    let Configuration { axis, label, .. } = configuration;
    Ok((Curve { axis: *axis, label: label.clone(), is_base: configuration.is_base, points }, whole))
}

/// Writes the page and its data.
pub fn write(folder: &Folder, study: &Study) -> Result<()> {
    let mut files = vec![
        (folder.file("index.html"), page::html(study).into_bytes()),
        (folder.file("study.json"), serde_json::to_vec_pretty(study).expect("a study is plain data")),
        (folder.file("points.csv"), findings::csv(study)),
    ];
    for (number, part) in study.parts.iter().enumerate() {
        for (name, drawn) in chart::all(part) {
            files.push((folder.file(&format!("{}-{name}.svg", number + 1)), chart::alone(&drawn).into_bytes()));
        }
    }
    write_all(files)
}
