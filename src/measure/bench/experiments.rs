//! The workloads that are timed.

use std::time::Instant;

use super::pass::Pass;
use super::room::{self, Timed};
use super::scale::{BALL_ROOM, ball_room};
use super::scene::{self, Job, named, radius_for, survey};
use super::{Bench, Lab, Size};
use crate::error::Result;
use crate::measure::compaction::{self, Map};
use crate::render::{Prepared, PreparedScene};
use crate::rng::Rng;
use crate::settings::scene::{Illumination, SceneSettings};
use crate::settings::{Builder, Preset, RoomSettings};

/// What is measured, by its name.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Experiment {
    pub name: &'static str,
    pub title: &'static str,
    measure: Measure,
}

#[derive(Debug, Clone, Copy)]
enum Measure {
    Passes(fn(&Lab) -> Result<Vec<Pass>>),
    Compaction,
}

const fn passes(name: &'static str, title: &'static str, measure: fn(&Lab) -> Result<Vec<Pass>>) -> Experiment {
    Experiment { name, title, measure: Measure::Passes(measure) }
}

/// The last takes all the time that is left.
pub(crate) const ALL: [Experiment; 8] = [
    passes("open-box", "open box, 15 bounces, every builder", open_box),
    passes("builders", "the paper's workload, 2 and 15 bounces, every builder", builders),
    passes("table-1", "last row of table 1", table_1),
    passes("index", "index of a large photon map", index),
    passes("gather", "gather at the points of a picture", gather),
    passes("cornell", "cornell, 16 bounces", cornell),
    passes("mesh", "many triangles", mesh),
    Experiment { name: "compaction", title: "fastest builder by photon count and survival", measure: Measure::Compaction },
];

pub(crate) fn by_name(name: &str) -> Option<Experiment> {
    ALL.into_iter().find(|experiment| experiment.name == name)
}

impl Experiment {
    /// Adds what it finds to the bench.
    pub(crate) fn run(self, lab: &mut Lab, bench: &mut Bench) -> Result<()> {
        match self.measure {
            Measure::Passes(measure) => bench.passes.extend(measure(lab)?),
            Measure::Compaction => bench.compaction = Some(compaction(lab)?),
        }
        Ok(())
    }
}

/// The paper's box at other sizes: cells of a centimetre, random numbers that fit any count, all photons at once.
fn large_box(builder: Builder, photons: u32, mesh: u32) -> RoomSettings {
    RoomSettings { builder, photons, mesh, radius: 0.01, rng: Rng::Philox, chunk: Some(photons), ..RoomSettings::default() }
}

/// Photons of a small run.
const FEW: u32 = 1 << 12;

/// The passes of several builders, one after another.
fn each(lab: &Lab, builders: &[Builder], time: impl Fn(Builder) -> Result<Vec<Pass>>) -> Result<Vec<Pass>> {
    let passes = builders.iter().map(|builder| {
        lab.go_on()?;
        time(*builder)
    });
    Ok(passes.collect::<Result<Vec<_>>>()?.concat())
}

fn time_room(lab: &Lab, settings: &RoomSettings) -> Result<Timed> {
    room::time(lab.gpu, &lab.rates, settings, lab.cancelled)
}

fn time_scene(lab: &Lab, job: &Job) -> Result<Vec<Pass>> {
    Ok(scene::time(lab.gpu, &lab.rates, job, lab.cancelled)?.passes)
}

fn open_box(lab: &Lab) -> Result<Vec<Pass>> {
    let (photons, mesh) = lab.choose((FEW, 16), (1 << 16, 64), (1 << 24, 64));
    each(lab, &Builder::ON_GPU, |builder| Ok(time_room(lab, &large_box(builder, photons, mesh))?.passes))
}

fn builders(lab: &Lab) -> Result<Vec<Pass>> {
    let (photons, mesh) = lab.choose((FEW, 16), (1 << 16, 32), (1 << 22, 64));
    let of_bounces = [2, 15].map(|bounces| {
        each(lab, &Builder::ON_GPU, |builder| {
            let settings = RoomSettings { bounces, radius: RoomSettings::default().radius, ..large_box(builder, photons, mesh) };
            let timed = time_room(lab, &settings)?;
            // The paper's atomics literally, where more counters serve the device better.
            let with_one = (timed.counters > 1).then(|| time_room(lab, &RoomSettings { counters: Some(1), ..settings })).transpose()?;
            Ok([timed.passes, with_one.map_or_else(Vec::new, |timed| timed.passes)].concat())
        })
    });
    let [two, fifteen] = of_bounces;
    Ok([two?, fifteen?].concat())
}

/// Photons that make a pass worth timing on a card: sixteen times as many as in the largest other experiment.
const MOST_COMPACTED: u32 = 1 << 28;

fn compaction(lab: &mut Lab) -> Result<Map> {
    let left = lab.deadline.saturating_duration_since(Instant::now());
    let all = compaction::CompactionRequest::up_to(lab.choose(FEW, 1 << 16, MOST_COMPACTED), left);
    let request = match lab.size {
        Size::Small => compaction::CompactionRequest { survivals: vec![0.25, 0.75], turns: 1, ..all },
        Size::Full => all,
    };
    compaction::measure(lab.gpu, &request, lab.scene, lab.cancelled, lab.report)
}

/// By the paper's builder, and by the one that wins at this size. The rounds of one run are as many samples as anybody needs.
fn table_1(lab: &Lab) -> Result<Vec<Pass>> {
    each(lab, &[Builder::Atomic, Builder::Persistent], |builder| {
        let settings = RoomSettings { builder, rounds: lab.choose(5, 50, 50), ..RoomSettings::preset(Preset::Rounds) };
        Ok(room::time_run(lab.gpu, &lab.rates, &settings, lab.cancelled)?.passes)
    })
}

fn index(lab: &Lab) -> Result<Vec<Pass>> {
    // Entries of the map.
    let wanted = lab.choose(1e4, 2e5, 1e7);
    let room = |photons: u32| time_room(lab, &large_box(Builder::Ballot, photons, 16));
    let share = room(FEW)?.counts.survivors / f64::from(FEW);
    let of_room = room((wanted / share) as u32)?;

    lab.go_on()?;
    let scene = named("cornell");
    let job = |photons: u32| Job {
        name: "cornell, all photons stored",
        scene: &scene,
        size: (64, 64),
        settings: SceneSettings { photons, bounces: 16, illumination: Illumination::Photons, block: Some(1), ..SceneSettings::default() },
    };
    let share = stored_share(lab, &job(FEW))?;
    Ok([of_room.passes, time_scene(lab, &job((wanted / share) as u32))?].concat())
}

/// Entries of the global map over the photons emitted.
fn stored_share(lab: &Lab, job: &Job) -> Result<f64> {
    let survey = survey(lab.gpu, job, |plan| plan.global.as_ref())?;
    Ok(survey.map_or(1.0, |survey| survey.stored / f64::from(job.settings.photons)))
}

/// Photons of an estimate.
const PER_ESTIMATE: f64 = 50.0;

fn gather(lab: &Lab) -> Result<Vec<Pass>> {
    let wanted = lab.choose(1e4, 1e5, 1e6);
    let size = lab.choose((96, 54), (480, 270), (1920, 1080));
    let scene = named("cornell");
    let job = |photons: u32, radius: Option<f64>, size: (u32, u32)| Job {
        name: "cornell, picture",
        scene: &scene,
        size,
        settings: SceneSettings { photons, radius, block: Some(1), ..SceneSettings::default() },
    };
    let photons = (wanted / stored_share(lab, &job(FEW, None, (64, 64)))?) as u32;
    // The second time corrects the first, as discs of another size reach over more or fewer edges.
    let mut radius = None;
    for _ in 0..2 {
        let job = job(photons, radius, size);
        let (Prepared { geometry, .. }, plan) = job.prepare(lab.gpu, &job.settings)?;
        radius = match (survey(lab.gpu, &job, |plan| plan.global.as_ref())?, plan.global) {
            (Some(survey), Some(map)) => Some(radius_for(&geometry, &survey, map.radius * geometry.unit, PER_ESTIMATE)),
            _ => None,
        };
    }
    time_scene(lab, &job(photons, radius, size))
}

fn cornell(lab: &Lab) -> Result<Vec<Pass>> {
    let scene = named("cornell");
    let photons = lab.choose(FEW, 1 << 16, 1 << 22);
    let settings = SceneSettings { photons, bounces: 16, illumination: Illumination::Photons, block: Some(1), ..SceneSettings::default() };
    let job = Job { name: "cornell, photons alone", scene: &scene, size: lab.image_size(), settings };
    by_two_builders(lab, &job)
}

fn mesh(lab: &Lab) -> Result<Vec<Pass>> {
    let scene = PreparedScene::new(ball_room(lab.choose(2_500, 25_000, 250_000)));
    let settings = SceneSettings { photons: lab.choose(FEW, 1 << 16, 1 << 21), block: Some(1), ..SceneSettings::default() };
    by_two_builders(lab, &Job { name: BALL_ROOM, scene: &scene, size: lab.image_size(), settings })
}

fn by_two_builders(lab: &Lab, job: &Job) -> Result<Vec<Pass>> {
    each(lab, &[Builder::Ballot, Builder::Persistent], |builder| {
        let settings = SceneSettings { builder: Some(builder), ..job.settings.clone() };
        time_scene(lab, &Job { settings, ..*job })
    })
}
