//! The workloads that the targets name.

use std::time::Instant;

use super::accuracy;
use super::experiment::{Experiment, Found};
use super::pass::median;
use super::room::{self, Counts, Timed};
use super::scale::{BALL_ROOM, ball_room};
use super::scene::{self, Job, named, radius_for, survey};
use super::targets::findings;
use super::{Bench, Lab, Size, tuning};
use crate::error::Result;
use crate::measure::compaction::{self, Map};
use crate::rng::Rng;
use crate::scene::geometry::Geometry;
use crate::settings::scene::{Effect, Illumination, SceneSettings};
use crate::settings::{Builder, Preset, RoomSettings};

/// Adds what an experiment finds to the bench.
pub fn run(lab: &mut Lab, experiment: Experiment, bench: &mut Bench) -> Result<()> {
    let (mut passes, found) = match experiment {
        Experiment::OpenBox => open_box(lab)?,
        Experiment::Builders => builders(lab)?,
        Experiment::Compaction => {
            bench.compaction = Some(compaction(lab)?);
            Found::default()
        }
        Experiment::Table1 => table_1(lab)?,
        Experiment::Index => index(lab)?,
        Experiment::Gather => gather(lab)?,
        Experiment::Cornell => cornell(lab)?,
        Experiment::CornellSpheres | Experiment::CausticSphere => accuracy::measure(lab, experiment.name())?,
        Experiment::Mesh => mesh(lab)?,
        Experiment::Effects => effects(lab)?,
        Experiment::Tuning => {
            for scene in lab.scenes {
                bench.tuning.push(tuning::measure(lab, scene)?);
            }
            Found::default()
        }
    };
    bench.passes.append(&mut passes);
    bench.targets.extend(findings(lab, experiment, found));
    Ok(())
}

/// The paper's box at other sizes: cells of a centimetre, random numbers that fit any count, all photons at once.
fn large_box(builder: Builder, photons: u32, mesh: u32) -> RoomSettings {
    RoomSettings { builder, photons, mesh, radius: 0.01, rng: Rng::Philox, chunk: Some(photons), ..RoomSettings::default() }
}

/// Photons of a small run.
const FEW: u32 = 1 << 12;

/// Items a second in a pass, by the builder that is fastest in it.
fn best_rate(
    lab: &Lab,
    builders: &[Builder],
    (pass, items): (&str, fn(&Counts) -> f64),
    how: &str,
    time: impl Fn(Builder) -> Result<Timed>,
) -> Result<Found> {
    let mut passes = Vec::new();
    let mut best: Option<(f64, Option<f64>, String)> = None;
    for builder in builders {
        lab.go_on()?;
        let timed = time(*builder)?;
        let rate = |ms: f64| items(&timed.counts) / ms * 1e3;
        let found = rate(timed.ms(pass));
        if best.as_ref().is_none_or(|best| found > best.0) {
            best = Some((found, timed.limit_ms(pass).map(rate), format!("{}, {how}", builder.name())));
        }
        passes.extend(timed.passes);
    }
    Ok((passes, best.into_iter().collect()))
}

fn open_box(lab: &mut Lab) -> Result<Found> {
    let photons = lab.choose(FEW, 1 << 16, 1 << 24);
    let settings = |builder| large_box(builder, photons, lab.choose(16, 64, 64));
    best_rate(lab, &Builder::ON_GPU, ("build", |counts| counts.events), &format!("{photons} photons per round"), |builder| {
        room::time(lab.gpu, &lab.rates, &settings(builder), lab.cancelled)
    })
}

fn builders(lab: &mut Lab) -> Result<Found> {
    let photons = lab.choose(FEW, 1 << 16, 1 << 22);
    let mut passes = Vec::new();
    let mut ratios = Vec::new();
    for bounces in [2, 15] {
        let (mut builds, mut one_counter) = (Vec::new(), None);
        for builder in Builder::ON_GPU {
            lab.go_on()?;
            let settings =
                RoomSettings { bounces, radius: RoomSettings::default().radius, ..large_box(builder, photons, lab.choose(16, 32, 64)) };
            let timed = room::time(lab.gpu, &lab.rates, &settings, lab.cancelled)?;
            builds.push((timed.ms("build"), timed.limit_ms("build")));
            passes.extend(timed.passes);
            // The paper's atomics literally, where more counters serve the device better.
            if timed.counters > 1 {
                let single = room::time(lab.gpu, &lab.rates, &RoomSettings { counters: Some(1), ..settings }, lab.cancelled)?;
                one_counter = Some(single.ms("build"));
                passes.extend(single.passes);
            }
        }
        let of = |wanted: Builder| builds[Builder::ON_GPU.iter().position(|builder| *builder == wanted).expect("it is timed")];
        let ((naive, naive_limit), (atomic, atomic_limit)) = (of(Builder::Naive), of(Builder::Atomic));
        let ratio = |over: f64, under: f64| if bounces == 2 { over / under } else { under / over };
        let limit = atomic_limit.zip(naive_limit).map(|(atomic, naive)| ratio(atomic, naive));
        let of_one = one_counter.map_or_else(String::new, |one| format!("; with a single counter: {:.2} x", ratio(one, naive)));
        ratios.push((ratio(atomic, naive), limit, format!("{photons} photons per round{of_one}")));
    }
    Ok((passes, ratios))
}

/// Photons that make a pass worth timing on a card: as many as the largest target's sixteenfold.
const MOST_COMPACTED: u32 = 1 << 28;

fn compaction(lab: &mut Lab) -> Result<Map> {
    let left = lab.deadline.saturating_duration_since(Instant::now());
    let all = compaction::Request::up_to(lab.choose(FEW, 1 << 16, MOST_COMPACTED), left);
    let request = match lab.size {
        Size::Small => compaction::Request { survivals: vec![0.25, 0.75], turns: 1, ..all },
        Size::Full => all,
    };
    compaction::measure(lab.gpu, &request, lab.scenes.first(), lab.cancelled, lab.tell)
}

fn table_1(lab: &mut Lab) -> Result<Found> {
    let mut passes = Vec::new();
    let mut best: Option<(f64, Option<f64>, String)> = None;
    // The paper's builder, and the one that wins at this size.
    for builder in [Builder::Atomic, Builder::Persistent] {
        lab.go_on()?;
        let settings = RoomSettings { builder, rounds: lab.choose(5, 50, 50), ..RoomSettings::preset(Preset::Rounds) };
        let runs = room::time_run(lab.gpu, &lab.rates, &settings, lab.cancelled)?;
        let seconds = 1e-3 * median(runs.iter().map(|run| run.run_ms).collect());
        if best.as_ref().is_none_or(|best| seconds < best.0) {
            let limit = runs[0].limit_of_round().map(|ms| 1e-3 * ms * f64::from(settings.rounds));
            let how = format!(
                "{} rounds of {} photons, {}, set-up included; {:.4} s wall time",
                settings.rounds,
                settings.photons,
                builder.name(),
                1e-3 * median(runs.iter().map(|run| run.wall_ms).collect())
            );
            best = Some((seconds, limit, how));
        }
        // The rounds of one run are as many samples as anybody needs.
        passes.extend(runs.into_iter().last().map(|run| run.passes).unwrap_or_default());
    }
    Ok((passes, best.into_iter().collect()))
}

/// Entries of the map whose index a target names.
const INDEXED: f64 = 1e7;

fn index(lab: &mut Lab) -> Result<Found> {
    let wanted = lab.choose(1e4, 2e5, INDEXED);
    // Of a pass, by what the map holds.
    let found = |timed: &Timed, pass: &str, stored: f64| {
        let seconds = |ms: f64| 1e-3 * ms * INDEXED / stored;
        let how = format!("measured with {stored:.0} photons in the map, time scaled in proportion");
        (seconds(timed.ms(pass)), timed.limit_ms(pass).map(seconds), how)
    };

    let room = |photons: u32| room::time(lab.gpu, &lab.rates, &large_box(Builder::Ballot, photons, 16), lab.cancelled);
    let share = room(FEW)?.counts.survivors / f64::from(FEW);
    let of_room = room((wanted / share) as u32)?;

    lab.go_on()?;
    let (scene, geometry) = named("cornell")?;
    let job = |photons: u32| Job {
        name: "cornell, all photons stored",
        scene: &scene,
        geometry: &geometry,
        size: (64, 64),
        settings: SceneSettings { photons, bounces: 16, illumination: Illumination::Photons, block: Some(1), ..SceneSettings::default() },
    };
    let share = stored_share(lab, &job(FEW))?;
    let of_scene = scene::time(lab.gpu, &lab.rates, &job((wanted / share) as u32), lab.cancelled)?;
    let stored = of_scene.pass("global/index").and_then(|pass| pass.work).map_or(f64::NAN, |work| work.items);
    let found = vec![found(&of_room, "index", of_room.counts.survivors), found(&of_scene, "global/index", stored)];
    Ok(([of_room.passes, of_scene.passes].concat(), found))
}

/// Entries of the global map over the photons emitted.
fn stored_share(lab: &Lab, job: &Job) -> Result<f64> {
    let survey = survey(lab.gpu, job, |plan| plan.global.as_ref())?;
    Ok(survey.map_or(1.0, |survey| survey.stored / f64::from(job.settings.photons)))
}

/// Photons of an estimate that a target names.
const PER_ESTIMATE: f64 = 50.0;

fn gather(lab: &mut Lab) -> Result<Found> {
    let wanted = lab.choose(1e4, 1e5, 1e6);
    let size = lab.choose((96, 54), (480, 270), (1920, 1080));
    let (scene, geometry) = named("cornell")?;
    let job = |photons: u32, radius: Option<f64>, size: (u32, u32)| Job {
        name: "cornell, picture",
        scene: &scene,
        geometry: &geometry,
        size,
        settings: SceneSettings { photons, radius, block: Some(1), ..SceneSettings::default() },
    };
    let survey = |job: &Job| survey(lab.gpu, job, |plan| plan.global.as_ref());
    let photons = (wanted / stored_share(lab, &job(FEW, None, (64, 64)))?) as u32;
    // The second time corrects the first, as discs of another size reach over more or fewer edges.
    let mut radius = None;
    for _ in 0..2 {
        let job = job(photons, radius, size);
        radius = match (survey(&job)?, job.plan(lab.gpu, &job.settings)?.global) {
            (Some(survey), Some(map)) => Some(radius_for(&geometry, &survey, map.radius * geometry.unit, PER_ESTIMATE)),
            _ => None,
        };
    }
    let job = job(photons, radius, size);
    let per_estimate = survey(&job)?.map_or(f64::NAN, |survey| survey.per_estimate);
    let timed = scene::time(lab.gpu, &lab.rates, &job, lab.cancelled)?;
    let how = format!("{} x {} points, {photons} photons emitted, {per_estimate:.1} per estimate", size.0, size.1);
    let found = (1e-3 * timed.ms("global/gather"), timed.limit_ms("global/gather").map(|ms| 1e-3 * ms), how);
    Ok((timed.passes, vec![found]))
}

fn cornell(lab: &mut Lab) -> Result<Found> {
    let (scene, geometry) = named("cornell")?;
    let photons = lab.choose(FEW, 1 << 16, 1 << 22);
    let settings = SceneSettings { photons, bounces: 16, illumination: Illumination::Photons, block: Some(1), ..SceneSettings::default() };
    let job = Job { name: "cornell, photons alone", scene: &scene, geometry: &geometry, size: lab.image_size(), settings };
    photons_per_second(lab, &job, "global/trace", "every hit stored")
}

fn mesh(lab: &mut Lab) -> Result<Found> {
    let scene = ball_room(lab.choose(2_500, 25_000, 250_000));
    let geometry = Geometry::new(&scene)?;
    let settings = SceneSettings { photons: lab.choose(FEW, 1 << 16, 1 << 21), block: Some(1), ..SceneSettings::default() };
    let job = Job { name: BALL_ROOM, scene: &scene, geometry: &geometry, size: lab.image_size(), settings };
    photons_per_second(lab, &job, "global", &format!("{} triangles", geometry.triangles.len()))
}

fn photons_per_second(lab: &Lab, job: &Job, pass: &str, how: &str) -> Result<Found> {
    let how = format!("{} photons per round, {how}", job.settings.photons);
    best_rate(lab, &[Builder::Ballot, Builder::Persistent], (pass, |counts| counts.emitted), &how, |builder| {
        let settings = SceneSettings { builder: Some(builder), ..job.settings.clone() };
        scene::time(lab.gpu, &lab.rates, &Job { settings, ..*job }, lab.cancelled)
    })
}

/// Times the same scene with what the plan drops, with that left out by hand, and with it forced on.
fn effects(lab: &mut Lab) -> Result<Found> {
    let (scene, geometry) = named("cornell")?;
    let photons = lab.choose(FEW, 1 << 16, 1 << 21);
    let job = |with: &[Effect], without: &[Effect]| Job {
        name: "cornell",
        scene: &scene,
        geometry: &geometry,
        size: lab.image_size(),
        settings: SceneSettings { photons, with: with.to_vec(), without: without.to_vec(), block: Some(1), ..SceneSettings::default() },
    };
    let usual = job(&[], &[]);
    let plan = usual.plan(lab.gpu, &usual.settings)?;
    let lacking: Vec<Effect> = plan.decisions.iter().filter(|decision| !decision.kept).map(|decision| decision.effect).collect();
    let jobs = [usual, job(&[], &lacking), job(&lacking, &[])];
    let mut round_ms = [const { Vec::new() }; 3];
    let mut passes = Vec::new();
    // In turn, so that a clock that drifts touches all alike.
    for _ in 0..lab.choose(1, 3, 3) {
        for (job, round_ms) in jobs.iter().zip(&mut round_ms) {
            lab.go_on()?;
            let timed = scene::time(lab.gpu, &lab.rates, job, lab.cancelled)?;
            round_ms.push(timed.round_ms);
            if passes.is_empty() {
                passes = timed.passes;
            }
        }
    }
    let [usual, without, forced] = round_ms.map(median);
    let how = format!("{} unneeded effects; forcing them on takes {:.2} x the time", lacking.len(), forced / usual);
    Ok((passes, vec![(usual / without, Some(1.0), how)]))
}
