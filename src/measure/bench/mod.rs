//! How close every pass comes to the device's limits (roofline).
//!
//! [`rates`] measures what the device can do, [`room`] and [`scene`] time the passes of both worlds beside what
//! they cannot do without ([`pass`]), [`experiments`] runs the workloads, and [`scale`] follows cost and memory over
//! photons and triangles.

pub(crate) mod chart;
pub(crate) mod experiments;
pub(crate) mod page;
pub(crate) mod pass;
pub(crate) mod rates;
pub(crate) mod room;
pub(crate) mod scale;
pub(crate) mod scene;
pub(crate) mod table;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::error::{Error, Result, named};
use crate::gpu::Gpu;
use crate::measure::compaction::{self, Map};
use crate::output::destination::{Folder, write_all};
use crate::render::names::{as_option, spelled};
use crate::scene::Scene;
use experiments::Experiment;
use pass::Pass;
use rates::Rates;
use scale::Scale;

/// How large the workloads are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Size {
    /// Seconds on a software device.
    Small,
    /// Minutes in all; on a software device smaller ones.
    Full,
}

/// What is asked for.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct BenchRequest {
    /// What repeats it.
    pub command: String,
    pub size: Size,
    #[serde(skip)]
    pub experiments: Vec<Experiment>,
    /// Builders are compared in it, beside the paper's box.
    #[serde(skip)]
    pub scene: Option<Scene>,
    /// Follow cost over photons and triangles instead.
    #[serde(skip)]
    pub scale: bool,
    /// Wall time after which no further experiment begins.
    #[serde(skip)]
    pub budget: Duration,
}

/// Everything that was found.
#[derive(Debug, Serialize)]
pub(crate) struct Bench {
    pub photonmill: &'static str,
    pub request: BenchRequest,
    pub device: String,
    pub driver: String,
    pub vulkan: String,
    pub rates: Rates,
    pub passes: Vec<Pass>,
    /// The fastest builder by photon count, in a closed room by survival, and in a scene.
    pub compaction: Option<Map>,
    pub scale: Option<Scale>,
    /// What was not measured, and why.
    pub left_out: Vec<String>,
}

/// What experiments share.
pub(crate) struct Lab<'a> {
    pub gpu: &'a Gpu,
    pub rates: Rates,
    pub scene: Option<&'a Scene>,
    pub size: Size,
    pub deadline: Instant,
    pub cancelled: &'a AtomicBool,
    pub report: &'a mut dyn FnMut(&str),
}

impl Lab<'_> {
    /// Whether workloads are cut to what a processor does.
    pub(crate) fn is_cpu(&self) -> bool {
        self.gpu.facts().kind == "cpu"
    }

    /// The number for a small run, for a processor, and for a card.
    pub(crate) fn choose<T>(&self, small: T, on_cpu: T, full: T) -> T {
        match (self.size, self.is_cpu()) {
            (Size::Small, _) => small,
            (Size::Full, true) => on_cpu,
            (Size::Full, false) => full,
        }
    }

    /// Of a picture in which the scene matters more than its points.
    pub(crate) fn image_size(&self) -> (u32, u32) {
        self.choose((32, 32), (128, 128), (512, 512))
    }

    /// Fails once the bench is interrupted.
    pub(crate) fn go_on(&self) -> Result<()> {
        if self.cancelled.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }

    pub(crate) fn is_late(&self) -> bool {
        Instant::now() >= self.deadline
    }
}

/// Measures the device, then the experiments that are asked for. Experiments that were complete when it was
/// interrupted are kept.
pub(crate) fn run(gpu: &Gpu, request: BenchRequest, cancelled: &AtomicBool, report: &mut dyn FnMut(&str)) -> Result<Bench> {
    room::check_clock(gpu)?;
    let deadline = Instant::now() + request.budget;
    report("limits of the device");
    let rates = rates::measure(gpu, request.size)?;
    let scene = request.scene.clone();
    let mut lab = Lab { gpu, rates, scene: scene.as_ref(), size: request.size, deadline, cancelled, report };
    let facts = gpu.facts();
    let mut bench = Bench {
        photonmill: env!("CARGO_PKG_VERSION"),
        device: facts.name.clone(),
        driver: facts.driver.clone(),
        vulkan: facts.vulkan.clone(),
        rates,
        passes: Vec::new(),
        compaction: None,
        scale: None,
        left_out: Vec::new(),
        request,
    };
    match measure(&mut lab, &mut bench) {
        Err(Error::Interrupted) => bench.left_out.push("the remaining experiments: interrupted".to_owned()),
        result => result?,
    }
    Ok(bench)
}

fn measure(lab: &mut Lab, bench: &mut Bench) -> Result<()> {
    if bench.request.scale {
        bench.scale = Some(scale::measure(lab, &mut bench.left_out)?);
        return Ok(());
    }
    for (number, experiment) in bench.request.experiments.clone().into_iter().enumerate() {
        lab.go_on()?;
        if lab.is_late() {
            bench.left_out.push(format!("{}: no --time left", experiment.name));
            continue;
        }
        (lab.report)(&format!("[{}/{}] {}", number + 1, bench.request.experiments.len(), experiment.title));
        match experiment.run(lab, bench) {
            Ok(()) => {}
            // What this device cannot do is no reason to end.
            Err(Error::Setting { option, value, allowed }) => {
                let line = format!("{}: {} {value} {allowed}", experiment.name, named(option));
                bench.left_out.push(spelled(&line, as_option));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

impl Bench {
    pub(crate) fn json(&self) -> Vec<u8> {
        let mut text = serde_json::to_vec_pretty(self).expect("a bench is plain data");
        text.push(b'\n');
        text
    }
}

/// Writes the report and its charts.
pub(crate) fn write(folder: &Folder, bench: &Bench) -> Result<()> {
    let mut files = vec![
        (folder.file("index.html"), page::html(bench).into_bytes()),
        (folder.file("bench.json"), bench.json()),
        (folder.file("bench.txt"), table::text(bench).into_bytes()),
    ];
    if let Some(map) = &bench.compaction {
        files.push((folder.file("compaction.svg"), compaction::chart::draw(map).as_file()));
    }
    if let Some(scale) = &bench.scale {
        files.extend(chart::all(scale).map(|(name, drawn)| (folder.file(&name), drawn)));
    }
    write_all(files)
}
