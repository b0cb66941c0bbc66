//! What accuracy costs in time: error against time on this device, for every option.
//!
//! A study runs each configuration of each axis ([`axes`]) at numbers of rounds that grow four-fold, several times with seeds of
//! their own, compares the results with a reference from another method ([`mod@reference`]), and writes what it found
//! as a page, CSV, JSON and SVG. Points that are finished are kept ([`store`]), so that a study that was cut off goes on
//! where it ended.

pub(crate) mod axes;
pub(crate) mod case;
pub(crate) mod chart;
pub(crate) mod details;
pub(crate) mod findings;
pub(crate) mod page;
pub mod peers;
pub(crate) mod point;
pub(crate) mod reference;
pub(crate) mod store;
pub(crate) mod strip;
pub(crate) mod summary;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::error::{Error, Result, named, require, within};
use crate::gpu::{Gpu, clock};
use crate::measure::compaction;
use crate::output::destination::{Folder, write_all};
use crate::render::names::{as_option, spelled};
use crate::scene::Scene;
use axes::{Axis, Group};
use case::StudyCase;
use peers::Peer;
use point::{Curve, Point};
use store::Store;
use strip::Strip;

/// What is asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyRequest {
    /// As the user names it.
    pub scene: String,
    /// Options of its light and its camera, as of `photonmill render`.
    #[serde(rename = "view", skip_serializing_if = "Vec::is_empty")]
    pub scene_options: Vec<String>,
    /// Pixels along the longer side of the picture, or texels along each wall of the paper's box.
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
    /// Errors that end runs with default settings, the largest first.
    #[serde(skip)]
    pub asked: Vec<f64>,
    /// Other programs on the same scene, for the chart.
    #[serde(skip)]
    pub peers: Vec<Peer>,
    /// Rounds of the longest point, whatever time is left.
    #[serde(skip)]
    pub most_rounds: u32,
}

/// srand48 takes 32 bits, and each run has a seed of its own.
pub(crate) const MAX_SEED: u64 = u32::MAX as u64 - 1000;
/// Of all runs of a choice, a gigabyte in all.
const MAX_HELD: u64 = 1 << 27;

impl StudyRequest {
    /// Of a scene, on a CPU or a GPU.
    pub fn usual(scene: &str, is_cpu: bool) -> StudyRequest {
        StudyRequest {
            scene: scene.to_owned(),
            scene_options: Vec::new(),
            size: match (scene == "open-box", is_cpu) {
                (true, true) => 24,
                (false, false) => 128,
                _ => 64,
            },
            photons: if is_cpu { 8192 } else { 1 << 18 },
            repeats: 5,
            seed: 1,
            reference_samples: 4096,
            budget: Duration::from_secs(240),
            asked: strip::ASKED.to_vec(),
            peers: Vec::new(),
            most_rounds: MOST_ROUNDS,
        }
    }

    pub fn validate(&self) -> Result<()> {
        within("side", self.size, 2..=1024, "pixels or texels along a side")?;
        within("photons", self.photons, 64..=1 << 28, "photons per round")?;
        within("rounds", self.most_rounds, 1..=MOST_ROUNDS, "rounds of the longest point")?;
        within("repeats", self.repeats, 2..=1000, "runs of a point, whose spread is its error")?;
        within("reference_samples", self.reference_samples, 16..=1 << 24, "samples per pixel")?;
        within("seed", self.seed, 0..=MAX_SEED, "seed of the first run")?;
        let held = 3 * u64::from(self.size).pow(2) * u64::from(self.repeats);
        let most = format!(
            "3 * side^2 * repeats is {held} numbers in memory for each setting, and {MAX_HELD} is the limit; use fewer, or a smaller `side`"
        );
        require(held <= MAX_HELD, "repeats", self.repeats, most)
    }
}

/// A budget of so many seconds.
pub fn budget(seconds: f64) -> Result<Duration> {
    require((1.0..=1e6).contains(&seconds), "budget", seconds, "must be from 1s to 1000000s")?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Everything that was found.
#[derive(Debug, Serialize)]
pub struct Study {
    pub photonmill: &'static str,
    /// The scene's own name.
    pub title: String,
    pub request: StudyRequest,
    pub device: String,
    pub driver: String,
    /// A software device, whose 'GPU' is the CPU.
    pub is_cpu: bool,
    pub(crate) parts: Vec<Part>,
    /// The fastest builder by photon count: of the open box by survival too, of another scene as it is.
    pub(crate) compaction: Option<compaction::Map>,
    /// False if it was ended before its last point.
    pub complete: bool,
}

/// One quantity and everything that was measured of it.
#[derive(Debug, Serialize)]
pub(crate) struct Part {
    pub quantity: String,
    /// Where the reference comes from and how well it is known.
    pub reference: String,
    /// Root mean square of the reference's own error over its root mean square.
    pub reference_error: f64,
    /// Errors below this say more of the reference than of what it judges.
    pub least_error: f64,
    pub comparisons: Vec<Comparison>,
    /// Runs with nothing set but their error, which a pilot divides; `None` of the paper's box.
    pub default: Option<Curve>,
    #[serde(skip)]
    pub strip: Option<Strip>,
}

/// Curves that were measured in turn: the base, then its alternatives along an axis.
#[derive(Debug, Serialize)]
pub(crate) struct Comparison {
    pub axis: Axis,
    pub curves: Vec<Curve>,
}

/// Runs a study, and reports a line for each axis.
pub fn run(
    gpu: &Gpu,
    scene: &Scene,
    request: StudyRequest,
    folder: &Folder,
    cancelled: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<Study> {
    let mut store = Store::open(folder, scene, &request, gpu.facts())?;
    let mut study = Study {
        photonmill: env!("CARGO_PKG_VERSION"),
        title: scene.name.clone(),
        device: gpu.facts().name.clone(),
        driver: gpu.facts().driver.clone(),
        is_cpu: gpu.facts().kind == "cpu",
        parts: Vec::new(),
        compaction: None,
        complete: false,
        request,
    };
    let cases = StudyCase::all(gpu, scene, &study.request, cancelled, report)?;
    for points in cases.iter().filter_map(StudyCase::points_file).take(1) {
        write_all([(folder.file(case::POINTS), points.into_bytes())])?;
    }
    let count: usize = cases.iter().flat_map(|case| &case.groups).map(|group| group.configurations.len()).sum();
    let is_of_paper = cases.iter().any(StudyCase::is_of_paper);
    let of_builders = study.request.budget / COMPACTION_SHARE;
    let of_defaults = study.request.budget / DEFAULTS_SHARE;
    let start = Instant::now();
    let with_default = cases.iter().filter(|case| case.has_default()).count().max(1) as u32;
    clock::warm_up(gpu, FIRST_WARM_UP)?;
    let mut begun = 0;
    for case in &cases {
        study.parts.push(Part {
            quantity: case.quantity.clone(),
            reference: case.reference.method.clone(),
            reference_error: case.reference.relative_error,
            least_error: case.reference.least_error(),
            comparisons: Vec::new(),
            default: None,
            strip: None,
        });
        if case.has_default() {
            report(&format!("{}: default settings, to an error of 20, 10, 5, 2 and 1 %", case.quantity));
            match strip::measure_defaults(gpu, case, &study.request, of_defaults / with_default, cancelled, &mut store) {
                Err(Error::Interrupted) => return Ok(study),
                found => study.parts.last_mut().expect("pushed above").default = Some(found?),
            }
        }
        for group in &case.groups {
            begun += group.configurations.len();
            report(&format!("[{begun}/{count}] {}: {}", case.quantity, group.axis.name()));
            // What is left is shared out evenly: pipelines and what the others did not use count.
            let left = (study.request.budget - of_builders).saturating_sub(start.elapsed());
            let share = left / (count + group.configurations.len() - begun).max(1) as u32;
            let mut measuring = Measuring { gpu, case, group, request: &study.request, share, cancelled, store: &mut store };
            let mut curves: Vec<Curve> = group.configurations.iter().map(|configuration| Curve::new(&configuration.label)).collect();
            let ended = measuring.climb(&mut curves);
            study.parts.last_mut().expect("pushed above").comparisons.push(Comparison { axis: group.axis, curves });
            match ended {
                Err(Error::Interrupted) => return Ok(study),
                result => result?,
            }
        }
    }
    if let Some((case, part)) = cases.iter().zip(&mut study.parts).next() {
        report("the pictures");
        match strip::strip(gpu, case, part, &study.request, cancelled) {
            Err(Error::Interrupted) => return Ok(study),
            found => part.strip = found?,
        }
    }
    let most = study.request.photons.saturating_mul(study.request.most_rounds).min(MOST_COMPACTED);
    let mut wanted = compaction::CompactionRequest::up_to(most, of_builders);
    // The paper's box has rooms of every survival beside it, a scene stands for itself.
    let alone = if is_of_paper { None } else { Some(scene) };
    if alone.is_some() {
        wanted.survivals.clear();
    }
    match compaction::measure(gpu, &wanted, alone, cancelled, report) {
        Ok(map) => study.compaction = Some(map),
        // What was measured before is worth its page.
        Err(error) => report(&format!("the comparison of builders was not measured: {error}")),
    }
    study.complete = !cancelled.load(Ordering::Relaxed);
    Ok(study)
}

/// A group under measurement.
struct Measuring<'a> {
    gpu: &'a Gpu,
    case: &'a StudyCase,
    group: &'a Group,
    request: &'a StudyRequest,
    /// Time for each configuration.
    share: Duration,
    cancelled: &'a AtomicBool,
    store: &'a mut Store,
}

impl Measuring<'_> {
    /// Points of every configuration at numbers of rounds that grow four-fold until its share of time is spent.
    fn climb(&mut self, curves: &mut [Curve]) -> Result<()> {
        for level in 0..=self.request.most_rounds.ilog(GROWTH) {
            let rounds = GROWTH.pow(level);
            // Those that have time left: a run's set-up takes as long as before, and its rounds longer.
            let next = |last: &Point| {
                let (seconds, of_rounds) = (last.spent().as_secs_f64(), 1e-3 * last.wall_ms.iter().sum::<f64>());
                Duration::from_secs_f64(seconds + f64::from(GROWTH - 1) * of_rounds.min(seconds))
            };
            let going: Vec<usize> = (0..curves.len())
                .filter(|which| {
                    let Curve { points, left_out, .. } = &curves[*which];
                    let spent: Duration = points.iter().map(Point::spent).sum();
                    let allowed = rounds <= self.group.configurations[*which].most_rounds();
                    let fits = points.last().is_none_or(|last| spent + next(last) <= self.share);
                    left_out.is_none() && points.len() == level as usize && allowed && fits
                })
                .collect();
            self.level(&going, rounds, curves)?;
        }
        Ok(())
    }

    /// Adds a point to each of these curves, their runs in turn.
    fn level(&mut self, going: &[usize], rounds: u32, curves: &mut [Curve]) -> Result<()> {
        let Measuring { gpu, case, group, request, cancelled, share, .. } = *self;
        let command = |which: usize| case.command(&group.configurations[which], rounds, request.seed);
        let known: Option<Vec<Point>> = going.iter().map(|which| self.store.find(group.axis, &command(*which))).collect();
        if let Some(known) = known {
            going.iter().zip(known).for_each(|(which, point)| curves[*which].points.push(point));
            return Ok(());
        }
        let mut shots = vec![Vec::new(); curves.len()];
        // The first turn of all is dropped: it makes pipelines.
        let first_turn = u64::from(going.iter().any(|which| !curves[*which].points.is_empty()));
        for turn in first_turn..=u64::from(request.repeats) {
            for which in going.iter().copied() {
                if curves[which].left_out.is_some() {
                    continue;
                }
                let began = Instant::now();
                let (rounds, seed) = if turn == 0 { (1, request.seed) } else { (rounds, request.seed + turn - 1) };
                match case.run(gpu, &group.configurations[which], rounds, seed, cancelled) {
                    Ok(shot) if turn == 0 => {
                        let seconds = 1e-3 * shot.wall_ms;
                        if seconds > PATIENCE.max(2 * share).as_secs_f64() {
                            curves[which].left_out = Some(format!("one round takes {seconds:.1} s, too long for the budget"));
                        }
                    }
                    Ok(shot) => shots[which].push((shot, began.elapsed())),
                    // What this device cannot do is no reason to end the study.
                    Err(Error::Setting { option, allowed, .. }) => {
                        curves[which].left_out = Some(spelled(&format!("{} {allowed}", named(option)), as_option));
                    }
                    Err(error) => return Err(error),
                }
            }
        }
        for which in going.iter().copied().filter(|which| !shots[*which].is_empty()) {
            let point = Point::of(&shots[which], &case.reference, command(which), rounds);
            self.store.add(group.axis, &point)?;
            curves[which].points.push(point);
        }
        Ok(())
    }
}

/// Times as many rounds from one point of a curve to the next.
const GROWTH: u32 = 4;

/// A card that idled while references were made takes longer to come to its clock than each run gives it.
const FIRST_WARM_UP: Duration = Duration::from_secs(3);

/// How long the first round of a configuration may take before it is left out; or twice its share of time, where that is longer.
const PATIENCE: Duration = Duration::from_secs(5);

/// Of the budget, for runs with default settings, for the map of builders, and most photons in it.
const DEFAULTS_SHARE: u32 = 4;
const COMPACTION_SHARE: u32 = 8;
const MOST_COMPACTED: u32 = 1 << 26;

/// Most that [`StudyRequest::most_rounds`] may be.
pub(crate) const MOST_ROUNDS: u32 = 1 << 20;

/// Writes the page and its data.
pub fn write(folder: &Folder, study: &Study) -> Result<()> {
    let mut files = vec![
        (folder.file("index.html"), page::html(study).into_bytes()),
        (folder.file("study.json"), serde_json::to_vec_pretty(study).expect("a study is plain data")),
        (folder.file("points.csv"), findings::csv(study)),
    ];
    for (number, part) in study.parts.iter().enumerate() {
        for (name, drawn) in chart::all(study, part) {
            files.push((folder.file(&format!("{}-{name}.svg", number + 1)), drawn.as_file()));
        }
    }
    if let Some(map) = &study.compaction {
        files.push((folder.file("compaction.svg"), compaction::chart::draw(map).as_file()));
    }
    write_all(files)
}
