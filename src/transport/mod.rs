//! Lighting a scene of triangles: rounds of photons, maps and visible points, on the GPU.
//!
//! Each round is independent: its own photons, its own paths from the camera, its own radius (Knaus and
//! Zwicker 2011). So the mean over rounds converges to the right answer, its variance tells the error, and
//! any round could run anywhere.
//!
//! ```text
//! see       paths from the camera over mirrors and glass: visible points, direct light by shadow rays
//! photons   of the global map: traced, sorted, looked up at every visible point
//! caustics  the same with photons that took mirrors and glass only, and were aimed at these
//! weigh     flux over area that really lies on the surface, times reflectance: light
//! resolve   all light of a pixel: to the film
//! ```

pub mod bias;
pub mod film;
pub mod photons;
pub mod points;
pub mod replay;
pub mod resources;
pub mod stop;
pub mod trial;

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

pub use film::RoundFilm;
use resources::{PhotonBuffers, TransportResources};

use crate::bias::Bias;
use crate::constants::{HIT_KINDS, PART_COUNT};
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::kernels::*;
use crate::gpu::{Commands, Constants, DeviceFacts, Gpu, Kernel, Module};
use crate::ledger::Fates;
use crate::oddities::Oddities;
use crate::plan::transport::{MapPlan, Sensor, TransportPlan};
use crate::records::Receiver;
use crate::render::Control;
pub use crate::render::stop::End;
use crate::render::stop::Watch;
use crate::scene::Camera;
use crate::scene::geometry::Geometry;
use crate::settings::Math;
use crate::settings::transport::Append;
use crate::tallies;
use crate::timings::{Clock, Span, Timings};

/// What is lit and what looks at it.
pub struct View<'a> {
    pub geometry: &'a Geometry,
    /// For a picture.
    pub camera: Option<&'a Camera>,
    /// Sets of receivers of equal length, one a round in turn; none for a picture.
    pub phases: &'a [Vec<Receiver>],
}

/// One round of a run: what its stages share.
#[derive(Clone, Copy)]
pub struct Round<'a> {
    pub resources: &'a TransportResources,
    pub geometry: &'a Geometry,
    pub plan: &'a TransportPlan,
    pub number: u32,
}

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct Lit {
    pub plan: TransportPlan,
    pub film: RoundFilm,
    /// Light of each part (direct, specular, caustic, indirect) over all pixels and channels, film units.
    pub part_totals: Vec<u64>,
    /// Fates of the photons of the global map and of the caustic map.
    pub fates: [Fates; 2],
    pub timings: Timings,
    pub device: DeviceFacts,
    pub end: End,
    /// What the radius adds to the error; `None` where nobody measured it.
    pub bias: Option<Bias>,
    pub dispatches: u64,
    pub submissions: u64,
    pub pipelines: usize,
    /// Values that were no number, values cut to the film's largest, and estimates on a mesh too dense for the
    /// area within the radius to be found.
    pub anomalies: [u32; 3],
    /// What `--paranoid` found; `None` where nobody looked.
    pub oddities: Option<Oddities>,
}

/// Kernels that the plan needs, and no others.
pub fn modules(plan: &TransportPlan, facts: &DeviceFacts) -> Vec<Module> {
    let mut modules = vec![Resolve::MODULE];
    modules.push(match plan.sensor {
        Sensor::Picture { .. } => crate::gpu::kernels::View::MODULE,
        Sensor::Receivers { .. } => Receive::MODULE,
    });
    if plan.maps().next().is_some() {
        modules.extend([MapCount::MODULE, MapScatter::MODULE, ScanBlocks::MODULE, ScanAdd::MODULE]);
        modules.extend([DispatchSize::MODULE, CrowdSize::MODULE, Weigh::MODULE]);
        modules.extend(match plan.settings.append {
            Append::Atomic => vec![Shine::MODULE, FlyAtomic::MODULE],
            Append::Ballot => vec![Shine::MODULE, FlyBallot::MODULE],
            Append::Persistent | Append::Auto => vec![FlyWhole::MODULE],
        });
        modules.push(if facts.int64_atomics { LookupU64::MODULE } else { LookupTwoWords::MODULE });
    }
    modules
}

/// Specialization constants of a plan.
pub fn constants(plan: &TransportPlan) -> Constants {
    plan.constants.iter().fold(Constants::new(plan.settings.group_size), |constants, (name, value)| constants.set(name, *value))
}

/// Timestamps that a round may need.
const TIMESTAMPS_PER_ROUND: u32 = 64;

/// Runs all rounds of a plan; progress is told in rounds.
pub fn light(gpu: &Gpu, view: &View, plan: TransportPlan, control: &mut Control) -> Result<Lit> {
    let started = Instant::now();
    if plan.settings.math == Math::Strict {
        strict_math(gpu)?;
    }
    let pipelines_before = gpu.pipeline_count();
    gpu.prepare(&modules(&plan, gpu.facts()), &constants(&plan))?;
    let mut commands = Commands::new(gpu, constants(&plan), started)?;
    commands.timings().count("run");
    commands.timings().count("plan");
    commands.timings().add(Span { name: "plan".into(), clock: Clock::Wall, start: Duration::ZERO, duration: plan.planned_in });
    if let Some(trial) = &plan.trial {
        let duration = Duration::from_secs_f64(trial.seconds);
        commands.timings().count("trial");
        commands.timings().add(Span { name: "trial".into(), clock: Clock::Wall, start: Duration::ZERO, duration });
    }
    let resources = commands.scope("set-up", |commands| TransportResources::new(gpu, commands, view.geometry, &plan, view.phases))?;
    commands.warm_up()?;
    commands.submit()?;

    let mut fates = [Fates::new(plan.settings.bounces), Fates::new(plan.settings.bounces)];
    let mut watch = Watch::new(plan.settings.stop, plan.settings.alpha, commands.started());
    let (mut done, mut settled, mut end) = (0, 0, End::Rounds);
    let mut submissions_settled = commands.submission_count();
    let photons_per_round = plan.maps().map(|map| u64::from(map.photons)).sum::<u64>();
    for number in 0..plan.settings.rounds {
        commands.scope("round", |commands| {
            one_round(commands, view, Round { resources: &resources, geometry: view.geometry, plan: &plan, number })
        })?;
        done = number + 1;
        let last = done == plan.settings.rounds;
        // Tallies are 32-bit on the device.
        let open = u64::from(done - settled + 1) * plan.maps().map(|map| u64::from(map.photons)).max().unwrap_or(0);
        let short = commands.timestamps_left() < TIMESTAMPS_PER_ROUND || open > u64::from(u32::MAX);
        let photons = u64::from(done) * photons_per_round;
        // A long round hands commands over by itself, and nobody has looked at the clock since.
        let submitted = commands.submission_count() > submissions_settled;
        let busy = submitted || commands.work() * 2 >= plan.work_per_submission;
        if last || short || busy || watch.is_due(done) || watch.may_end(done, photons) {
            settle(&mut commands, &resources, &plan, u64::from(done - settled), &mut fates)?;
            settled = done;
            if watch.is_due(done) {
                let film = film(&mut commands, &resources, &plan, done)?;
                watch.look(done, film.relative_error(&plan), film.unknown(&plan, plan.settings.stop.confidence).relative);
            }
            submissions_settled = commands.submission_count();
            let ledger = fates[0].ledger().plus(&fates[1].ledger());
            (control.progress)(&watch.progress(f64::from(done), plan.settings.rounds, photons_per_round, ledger));
            let cancelled = control.cancelled.load(Ordering::Relaxed).then_some(End::Cancelled);
            let reason = if last { watch.has_photons(photons).then_some(End::Photons) } else { watch.end(done, photons).or(cancelled) };
            if let Some(reason) = reason {
                end = reason;
                break;
            }
        }
    }
    let film = film(&mut commands, &resources, &plan, done)?;
    let part_totals = commands.read::<u64>(&resources.part_totals, PART_COUNT as usize)?;
    let anomalies = commands.read::<u32>(&resources.anomalies, 3)?;
    let oddities = if plan.settings.paranoid { Some(Oddities::read(&mut commands, &resources.oddities)?) } else { None };
    gpu.check_validation()?;
    Ok(Lit {
        film,
        part_totals,
        fates,
        end,
        bias: None,
        dispatches: commands.dispatch_count(),
        submissions: commands.submission_count(),
        pipelines: gpu.pipeline_count() - pipelines_before,
        timings: commands.finish("run"),
        device: gpu.facts().clone(),
        anomalies: [anomalies[0], anomalies[1], anomalies[2]],
        oddities,
        plan,
    })
}

fn film(commands: &mut Commands, resources: &TransportResources, plan: &TransportPlan, rounds: u32) -> Result<RoundFilm> {
    let pixels = plan.sensor.pixels() as usize;
    let sums = commands.read::<u64>(&resources.film_sums, 3 * pixels)?;
    let squares = commands.read::<u64>(&resources.film_squares, 6 * pixels)?;
    let one_hits = commands.read::<u32>(&resources.one_hits, HIT_KINDS as usize * pixels)?;
    Ok(RoundFilm::new(rounds, sums, squares, one_hits))
}

fn one_round(commands: &mut Commands, view: &View, round: Round) -> Result<()> {
    let Round { resources, plan, .. } = round;
    commands.scope("see", |commands| points::see(commands, round, view.camera))?;
    let sums = 3 * u64::from(plan.visible_points()) * u64::from(plan.arrival_sets);
    if let Some(photons) = &resources.photons {
        commands.fill(&resources.estimates, 0, 2 * sums, 0);
        for map in plan.maps() {
            commands.scope(map.name, |commands| one_map(commands, round, photons, map))?;
        }
        commands.scope("weigh", |commands| points::weigh(commands, round))?;
    }
    commands.scope("resolve", |commands| points::resolve(commands, round))
}

/// Work of one flight of a photon, in the plan's units.
const WORK_PER_PHOTON: u64 = 256;

fn one_map(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan) -> Result<()> {
    for chunk in map.chunks() {
        if commands.timestamps_left() < TIMESTAMPS_PER_ROUND || commands.work() >= round.plan.work_per_submission {
            commands.submit()?;
        }
        let cells = photons::cells(round, map);
        commands.scope("trace", |commands| photons::trace(commands, round, photons, map, chunk))?;
        commands.add_work(WORK_PER_PHOTON * u64::from(chunk.1));
        commands.scope("index", |commands| photons::index(commands, photons, round.plan, &cells))?;
        commands.scope("look up", |commands| points::look_up(commands, round, photons, map, cells))?;
    }
    Ok(())
}

/// Runs what is recorded and books the fates of its photons.
fn settle(
    commands: &mut Commands,
    resources: &TransportResources,
    plan: &TransportPlan,
    rounds: u64,
    fates: &mut [Fates; 2],
) -> Result<()> {
    for map in plan.maps() {
        let which = usize::from(map.caustic_only);
        let tallies = &resources.photons.as_ref().expect("a map has photons").tallies[which];
        let counts = tallies::read(commands, tallies, plan.settings.bounces)?;
        tallies::clear(commands, tallies);
        fates[which].add(rounds * u64::from(map.photons), &counts);
        let ledger = fates[which].ledger();
        if !ledger.closes() || ledger.dropped != 0 {
            return Err(Error::LedgerOpen { ledger });
        }
    }
    if plan.maps().next().is_none() {
        commands.submit()?;
    }
    Ok(())
}
