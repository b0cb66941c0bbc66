//! Lighting a scene of triangles: rounds of photons, maps and visible points, on the GPU.
//!
//! Each round is independent: its own photons, its own paths from the camera, its own radius (Knaus and
//! Zwicker 2011). So the mean over rounds converges to the right answer, its variance tells the error, and
//! any round could run anywhere.
//!
//! ```text
//! see       paths from the camera over mirrors and glass: visible points, direct light by shadow rays
//! photons   of the global map: traced, sorted, gathered at every visible point
//! caustics  the same with photons that took mirrors and glass only, and were aimed at these
//! radiance  from flux over the area that lies on the surface, times reflectance
//! resolve   all light of a pixel: to the film
//! ```

pub mod bias;
pub mod film;
pub mod losses;
pub mod photons;
pub mod points;
pub mod replay;
pub mod resources;
pub mod stop;
pub mod trial;

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

pub use crate::ledger::Losses;
pub use film::SceneFilm;
use resources::{PhotonBuffers, SceneResources};

use crate::constants::{HIT_KINDS, PART_COUNT, TALLY_COPIES};
use crate::engine::Control;
use crate::engine::bias::Bias;
use crate::engine::nonfinite_values::NonfiniteValues;
pub use crate::engine::watch::End;
use crate::engine::watch::Watch;
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::kernels::*;
use crate::gpu::{Commands, Constants, DeviceFacts, Gpu, Interrupt, Kernel, Module};
use crate::ledger::{Fates, Ledger};
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::records::{Receiver, Tally};
use crate::scene::Camera;
use crate::scene::geometry::Geometry;
use crate::settings::Math;

use crate::engine::tallies;
use crate::engine::totals;
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
    pub resources: &'a SceneResources,
    pub geometry: &'a Geometry,
    pub plan: &'a ScenePlan,
    pub number: u32,
}

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct RunResult {
    pub plan: ScenePlan,
    pub film: SceneFilm,
    /// Light of each part (direct, specular, caustic, indirect) over all pixels and channels, film units.
    pub part_totals: Vec<u64>,
    /// Fates of the photons of the global map and of the caustic map.
    pub fates: [Fates; 2],
    pub timings: Timings,
    pub device: DeviceFacts,
    pub end: End,
    /// The bias of the radius; `None` where it was not measured.
    pub bias: Option<Bias>,
    pub dispatches: u64,
    pub submissions: u64,
    pub pipelines: usize,
    /// Values that were no number, values clamped to the film's largest, and estimates on a mesh too dense for the
    /// area within the radius to be found.
    pub anomalies: [u32; 3],
    /// Light that limits kept from the result.
    pub losses: Losses,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

/// Kernels that the plan needs, and no others.
pub fn modules(plan: &ScenePlan, facts: &DeviceFacts) -> Vec<Module> {
    let mut modules = vec![Resolve::MODULE];
    modules.push(match plan.sensor {
        Sensor::Picture { .. } => crate::gpu::kernels::View::MODULE,
        Sensor::Receivers { .. } => Receive::MODULE,
    });
    if plan.chains_go_on() {
        modules.push(GoOn::MODULE);
    }
    if plan.maps().next().is_some() {
        modules.extend([CrowdSize::MODULE, FluxToRadiance::MODULE]);
        modules.extend(photons::modules(plan));
        modules.push(if facts.int64_atomics { GatherVisiblePointsU64::MODULE } else { GatherVisiblePointsTwoWords::MODULE });
    }
    modules
}

/// Specialization constants of a plan.
pub fn constants(plan: &ScenePlan) -> Constants {
    plan.constants.iter().fold(Constants::new(plan.settings.group_size), |constants, (name, value)| constants.set(name, *value))
}

/// Timestamps that a round may need.
const TIMESTAMPS_PER_ROUND: u32 = 64;

/// Runs all rounds of a plan; progress is reported in rounds.
pub fn light(gpu: &Gpu, view: &View, plan: ScenePlan, control: &mut Control) -> Result<RunResult> {
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
    let resources = commands.scope("set-up", |commands| SceneResources::new(gpu, commands, view.geometry, &plan, view.phases))?;
    commands.warm_up()?;
    commands.submit()?;

    let mut state = RunState::new(&plan);
    let mut watch = Watch::new(plan.settings.stop, plan.settings.alpha, commands.started());
    let (mut done, mut end) = (0, None);
    let photons_per_round = plan.maps().map(|map| u64::from(map.photons)).sum::<u64>();
    while end.is_none() {
        let number = done;
        // There must be a first round: when the time is up in it, it ends with the photons that it has by then.
        let deadline = watch.deadline();
        commands.set_interrupt(Some(Interrupt { cancelled: control.cancelled, deadline: deadline.filter(|_| number > 0) }));
        let round = Round { resources: &resources, geometry: view.geometry, plan: &plan, number };
        let traced =
            match commands.scope("round", |commands| one_round(commands, view, round, deadline.filter(|_| number == 0), &mut state)) {
                Ok(traced) => traced,
                Err(Error::Interrupted) => {
                    commands.set_interrupt(None);
                    if number == 0 {
                        return Err(Error::Interrupted);
                    }
                    // A round cut short is no part of the film.
                    state.collect(&mut commands, &resources, &plan, true)?;
                    end = Some(if control.cancelled.load(Ordering::Relaxed) { End::Cancelled } else { End::Time });
                    break;
                }
                Err(error) => return Err(error),
            };
        commands.set_interrupt(None);
        done = number + 1;
        let last = done == plan.settings.rounds || traced < photons_per_round;
        let short = commands.timestamps_left() < TIMESTAMPS_PER_ROUND || state.open() + photons_per_round > u64::from(u32::MAX);
        let photons = u64::from(done) * photons_per_round;
        // A long round hands commands over by itself, and nobody has looked at the clock since.
        let submitted = commands.submission_count() > state.submissions;
        let busy = submitted || commands.work() * 2 >= commands.paced(plan.work_per_submission);
        if last || short || busy || watch.is_due(done) || watch.may_end(done, photons) {
            state.collect(&mut commands, &resources, &plan, false)?;
            if watch.is_due(done) {
                let film = film(&mut commands, &resources, &plan, done)?;
                let losses = losses(&mut commands, &resources, view, &plan, &state, &film)?;
                let unknown = film.unknown(&plan, plan.settings.stop.confidence).relative;
                watch.look(done, film.relative_error(&plan), unknown, losses.relative);
                watch.check_losses(plan.settings.bounces)?;
            }
            state.submissions = commands.submission_count();
            (control.progress)(&watch.progress(f64::from(done), plan.settings.rounds, photons_per_round, state.ledger()));
            let cancelled = control.cancelled.load(Ordering::Relaxed).then_some(End::Cancelled);
            end = match (traced < photons_per_round, done == plan.settings.rounds) {
                (true, _) => Some(End::Time),
                (_, true) => Some(if watch.has_photons(photons) { End::Photons } else { End::Rounds }),
                _ => watch.end(done, photons).or(cancelled),
            };
        }
    }
    let film = film(&mut commands, &resources, &plan, done)?;
    let losses = losses(&mut commands, &resources, view, &plan, &state, &film)?;
    let part_totals = commands.read::<u64>(&resources.part_totals, PART_COUNT as usize)?;
    let anomalies = commands.read::<u32>(&resources.anomalies, 3)?;
    let nonfinite_values =
        if plan.settings.paranoid { Some(NonfiniteValues::read(&mut commands, &resources.nonfinite_values)?) } else { None };
    gpu.check_validation()?;
    Ok(RunResult {
        film,
        part_totals,
        fates: state.fates,
        end: end.unwrap_or(End::Rounds),
        bias: None,
        dispatches: commands.dispatch_count(),
        submissions: commands.submission_count(),
        pipelines: gpu.pipeline_count() - pipelines_before,
        timings: commands.finish("run"),
        device: gpu.facts().clone(),
        anomalies: [anomalies[0], anomalies[1], anomalies[2]],
        losses,
        nonfinite_values,
        plan,
    })
}

fn film(commands: &mut Commands, resources: &SceneResources, plan: &ScenePlan, rounds: u32) -> Result<SceneFilm> {
    let pixels = plan.sensor.pixels() as usize;
    let sums = commands.read::<u64>(&resources.film_sums, 3 * pixels)?;
    let squares = commands.read::<u64>(&resources.film_squares, 6 * pixels)?;
    let one_hits = commands.read::<u32>(&resources.one_hits, HIT_KINDS as usize * pixels)?;
    Ok(SceneFilm::new(rounds, sums, squares, one_hits))
}

/// Photons and their fates, as far as the host has looked.
struct RunState {
    /// Of the global map's photons and of the caustic map's.
    fates: [Fates; 2],
    /// Photons traced since the last look, of each.
    open: [u64; 2],
    /// Submissions at the last look.
    submissions: u64,
}

impl RunState {
    fn new(plan: &ScenePlan) -> RunState {
        RunState { fates: [0, 1].map(|_| Fates::of_scene(plan.settings.bounces)), open: [0; 2], submissions: 0 }
    }

    /// Most photons of a map of which the host does not know the fates; the device counts them in 32 bits.
    fn open(&self) -> u64 {
        self.open[0].max(self.open[1])
    }

    fn ledger(&self) -> Ledger {
        self.fates[0].ledger().plus(&self.fates[1].ledger())
    }

    /// Runs what is recorded and adds up the fates of its photons. Those of a run that was interrupted may still be under way.
    fn collect(&mut self, commands: &mut Commands, resources: &SceneResources, plan: &ScenePlan, interrupted: bool) -> Result<()> {
        let Some(photons) = &resources.photons else { return commands.submit() };
        let copies = (plan.tally_rows() * TALLY_COPIES) as usize;
        let mut read_backs = Vec::new();
        for map in plan.maps() {
            let which = usize::from(map.caustic_only);
            let (tallies, totals) = (&photons.tallies[which], &photons.totals[which]);
            read_backs.push((
                which,
                commands.copy_out::<Tally>(tallies, copies)?,
                commands.copy_out::<u32>(totals, totals::WORDS as usize)?,
            ));
            tallies::clear(commands, tallies);
            totals::clear(commands, totals);
        }
        commands.submit()?;
        for (which, tallies, totals) in read_backs {
            let fates = &mut self.fates[which];
            fates.add(std::mem::take(&mut self.open[which]), &tallies::sums(&tallies.take()));
            fates.add_totals(&totals::sum(&totals.take()));
            if interrupted {
                fates.interrupt();
            }
            let ledger = fates.ledger();
            if !ledger.closes() || ledger.dropped != 0 {
                return Err(Error::LedgerOpen { ledger });
            }
        }
        Ok(())
    }
}

/// Light that limits have kept from the film so far.
fn losses(
    commands: &mut Commands,
    resources: &SceneResources,
    view: &View,
    plan: &ScenePlan,
    state: &RunState,
    film: &SceneFilm,
) -> Result<Losses> {
    let anomalies = commands.read::<u32>(&resources.anomalies, losses::ANOMALY_WORDS)?;
    let part_totals = commands.read::<u64>(&resources.part_totals, PART_COUNT as usize)?;
    Ok(losses::losses(view.geometry, plan, &state.fates, &anomalies, &part_totals, film))
}

/// Photons of the first chunk of a round in which the time may be up, and how long a chunk may take that the next one doubles.
const FIRST_TIMED_CHUNK: u32 = 1 << 12;
const TIMED_CHUNK: Duration = Duration::from_millis(40);

/// One round; says how many photons it traced. When its time is up, it takes no further chunk of photons.
fn one_round(commands: &mut Commands, view: &View, round: Round, deadline: Option<Instant>, state: &mut RunState) -> Result<u64> {
    let Round { resources, plan, .. } = round;
    commands.scope("visible points", |commands| points::see(commands, round, view.camera))?;
    let sums = 3 * u64::from(plan.visible_points()) * u64::from(plan.arrival_sets);
    let mut traced = [0u32; 2];
    if let Some(photons) = &resources.photons {
        commands.fill(&resources.estimates, 0, sums, 0);
        for map in plan.maps() {
            let which = usize::from(map.caustic_only);
            commands.scope(map.name, |commands| {
                // Where the time may be up, chunks grow only as long as they take little of it.
                let mut most = if deadline.is_some() { FIRST_TIMED_CHUNK } else { map.chunk_photons };
                while traced[which] < map.photons {
                    let began = Instant::now();
                    if traced[which] > 0 && deadline.is_some_and(|deadline| began >= deadline) {
                        break;
                    }
                    let count = most.min(map.chunk_photons).min(map.photons - traced[which]);
                    state.open[which] += u64::from(count);
                    one_chunk(commands, round, photons, map, (traced[which], count))?;
                    traced[which] += count;
                    if deadline.is_some() {
                        commands.submit()?;
                        most = if began.elapsed() < TIMED_CHUNK { most.saturating_mul(2) } else { most };
                    }
                }
                Ok(())
            })?;
        }
        commands.scope("flux to radiance", |commands| points::flux_to_radiance(commands, round, traced))?;
    }
    commands.scope("resolve", |commands| points::resolve(commands, round))?;
    Ok(traced.iter().map(|count| u64::from(*count)).sum())
}

fn one_chunk(commands: &mut Commands, round: Round, photons: &PhotonBuffers, map: &MapPlan, chunk: (u32, u32)) -> Result<()> {
    if commands.timestamps_left() < TIMESTAMPS_PER_ROUND || commands.work() >= commands.paced(round.plan.work_per_submission) {
        commands.submit()?;
    }
    let cells = photons::cells(round, map);
    photons::trace(commands, round, photons, map, chunk, &mut |commands| {
        commands.scope("index", |commands| photons::index(commands, round, photons, map, &cells))?;
        commands.scope("gather", |commands| points::gather(commands, round, photons, map, cells))
    })
}
