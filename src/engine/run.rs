//! The one loop over rounds, of every run: until something ends it, with the fate of every photon.

use std::sync::atomic::Ordering;
use std::time::Instant;

use super::bias::Bias;
use super::error_bound::FilmError;
use super::nonfinite_values::NonfiniteValues;
use super::watch::{Control, End, Progress, Watch};
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::{Commands, Constants, DeviceFacts, Gpu, Module};
use crate::ledger::{Fates, Ledger, Losses};
use crate::records::Tally;
use crate::settings::Math;
use crate::settings::stop::Stop;
use crate::timings::{HostClock, Timings};

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct RunResult<Plan, Film> {
    pub plan: Plan,
    pub film: Film,
    /// Of the photons of each map.
    pub fates: Vec<Fates>,
    pub timings: Timings,
    /// `None` for the CPU builder.
    pub device: Option<DeviceFacts>,
    pub end: End,
    /// The bias of the radius; `None` where it was not measured.
    pub bias: Option<Bias>,
    /// Light that limits kept from the result.
    pub losses: Losses,
    pub dispatches: u64,
    pub submissions: u64,
    /// Pipelines that the run made.
    pub pipelines: usize,
    /// Nonfinite values that `--paranoid` found; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

impl<Plan, Film> RunResult<Plan, Film> {
    /// Ended from outside before its last photon.
    pub fn is_cancelled(&self) -> bool {
        self.end == End::Cancelled
    }

    /// Fails if it was.
    pub fn finished(self) -> Result<Self> {
        if self.is_cancelled() { Err(Error::Interrupted) } else { Ok(self) }
    }

    /// `cpu` without a device.
    pub fn device_name(&self) -> &str {
        self.device.as_ref().map_or("cpu", |facts| &facts.name)
    }

    /// Of the photons of all maps.
    pub fn ledger(&self) -> Ledger {
        sum_of(&self.fates)
    }
}

/// What a run of a world is to do.
pub struct Task<'a> {
    /// The device, and its pipelines before the run; `None` for the CPU.
    pub device: Option<(&'a Gpu, usize)>,
    pub stop: Stop,
    /// How fast the radius shrinks; 1 keeps it.
    pub alpha: f64,
    pub rounds: u32,
    pub bounces: u32,
    /// Of all maps.
    pub photons_per_round: u64,
    /// Parts of a round after each of which a run may end. What a round left that ended in its middle counts in the mean.
    pub parts_per_round: u32,
    /// At most.
    pub photons_per_part: u64,
    /// Whether progress is counted in photons, not in rounds.
    pub counts_photons: bool,
    /// Of each map.
    pub fates: Vec<Fates>,
}

/// What rounds are recorded with, and timed by: commands of a device, or the host's clock.
pub trait Recorder {
    /// Runs `body` as a round, and times it.
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()>;
    /// The zero of all times.
    fn started(&self) -> Instant;
    /// Dispatches and submissions so far.
    fn counts(&self) -> [u64; 2];
    fn finish(self) -> Timings;
}

/// What is lit: the paper's box or a scene, on a device or on the CPU.
pub trait World {
    type Recorder: Recorder;
    type Film;

    /// Records a part of the round under way, and tells `state` of its photons. Fails with [`Error::Interrupted`] where the round
    /// was cut short and nothing of it counts.
    fn trace(&mut self, recorder: &mut Self::Recorder, state: &mut RunState, part: u32) -> Result<()>;
    /// Whether what is recorded must run now, as there is no room for another part, or it would take long.
    fn is_full(&self, recorder: &Self::Recorder) -> bool;
    /// Runs what is recorded and counts the fates of its photons.
    fn collect(&mut self, recorder: &mut Self::Recorder, state: &mut RunState) -> Result<()>;
    /// What all photons so far have left.
    fn film(&mut self, recorder: &mut Self::Recorder, state: &RunState) -> Result<Self::Film>;
    fn error(&self, film: &Self::Film) -> FilmError;
    /// Light that limits kept from a film.
    fn losses(&self, film: &Self::Film, fates: &[Fates]) -> Losses;
    /// What `--paranoid` found; `None` without it.
    fn nonfinite_values(&mut self, recorder: &mut Self::Recorder) -> Result<Option<NonfiniteValues>>;
}

/// How far a run has come, and whether it goes on.
pub struct RunState<'a> {
    task: Task<'a>,
    watch: Watch,
    /// Of each map, as far as they are collected.
    pub fates: Vec<Fates>,
    /// Photons of each map that were handed out since.
    open: Vec<u64>,
    /// Photons handed out.
    pub emitted: u64,
    /// Rounds that have ended; the number of the one under way.
    pub rounds: u32,
    /// Submissions at the latest look.
    submissions: u64,
    end: Option<End>,
}

/// Runs a world that is set up to its end.
pub fn run<W: World, Plan: Clone>(
    mut world: W,
    mut recorder: W::Recorder,
    plan: &Plan,
    task: Task,
    control: &mut Control,
) -> Result<RunResult<Plan, W::Film>> {
    let mut state = RunState::new(task, &recorder);
    while state.end.is_none() {
        let round = recorder.round(|recorder| {
            for part in 0..state.task.parts_per_round {
                if part > 0 && state.pause(&mut world, recorder, control)? {
                    return Ok(());
                }
                world.trace(recorder, &mut state, part)?;
            }
            state.rounds += 1;
            Ok(())
        });
        match round {
            // A round cut short is no part of the film; without a first round there is none.
            Err(Error::Interrupted) if state.rounds > 0 => {
                state.collect(&mut world, &mut recorder, true)?;
                state.end = Some(if control.cancelled.load(Ordering::Relaxed) { End::Cancelled } else { End::Time });
            }
            Err(error) => return Err(error),
            // Within the round.
            Ok(()) if state.end.is_some() => break,
            Ok(()) => {
                state.pause(&mut world, &mut recorder, control)?;
            }
        }
    }
    let film = world.film(&mut recorder, &state)?;
    let nonfinite_values = world.nonfinite_values(&mut recorder)?;
    let device = state.task.device;
    if let Some((gpu, _)) = device {
        gpu.check_validation()?;
    }
    let [dispatches, submissions] = recorder.counts();
    Ok(RunResult {
        losses: world.losses(&film, &state.fates),
        film,
        fates: state.fates,
        device: device.map(|(gpu, _)| gpu.facts().clone()),
        end: state.end.expect("the run has ended"),
        bias: None,
        dispatches,
        submissions,
        pipelines: device.map_or(0, |(gpu, before)| gpu.pipeline_count() - before),
        nonfinite_values,
        timings: recorder.finish(),
        plan: plan.clone(),
    })
}

/// Refuses arithmetic that the device does not do.
pub fn check_math(gpu: &Gpu, math: Math) -> Result<()> {
    if math == Math::Strict { strict_math(gpu) } else { Ok(()) }
}

/// The commands of a run on a device that makes these pipelines, and no others; `started` is the zero of its times. With the
/// pipelines that there were before.
pub fn commands<'gpu>(
    gpu: &'gpu Gpu,
    modules: &[Module],
    constants: Constants,
    math: Math,
    started: Instant,
) -> Result<(Commands<'gpu>, usize)> {
    check_math(gpu, math)?;
    let pipelines_before = gpu.pipeline_count();
    gpu.prepare(modules, &constants)?;
    let mut commands = Commands::new(gpu, constants, started)?;
    commands.timings().count("run");
    Ok((commands, pipelines_before))
}

impl<'a> RunState<'a> {
    fn new(task: Task<'a>, recorder: &impl Recorder) -> RunState<'a> {
        RunState {
            watch: Watch::new(task.stop, task.alpha, recorder.started()),
            fates: task.fates.clone(),
            open: vec![0; task.fates.len()],
            emitted: 0,
            rounds: 0,
            submissions: recorder.counts()[1],
            end: None,
            task,
        }
    }

    /// When the run's time is up.
    pub fn deadline(&self) -> Option<Instant> {
        self.watch.deadline()
    }

    /// So many photons of a map are handed out.
    pub fn hand_out(&mut self, map: usize, photons: u32) {
        self.open[map] += u64::from(photons);
        self.emitted += u64::from(photons);
    }

    /// Counts the fates of all photons of a map that were handed out.
    pub fn count(&mut self, map: usize, tallies: &[Tally]) {
        self.fates[map].add(std::mem::take(&mut self.open[map]), tallies);
    }

    /// Whether the run is between two rounds.
    pub fn is_whole(&self) -> bool {
        self.emitted == u64::from(self.rounds) * self.task.photons_per_round
    }

    /// Whether the time was up in the first round, so that it ended with the photons that it had.
    fn is_short(&self) -> bool {
        self.emitted < u64::from(self.rounds) * self.task.photons_per_round
    }

    /// Runs what is recorded where that is due, looks at it, and says whether the run ends.
    fn pause<W: World>(&mut self, world: &mut W, recorder: &mut W::Recorder, control: &mut Control) -> Result<bool> {
        if !self.is_due(world, recorder) {
            return Ok(false);
        }
        self.collect(world, recorder, false)?;
        if self.is_whole() && self.watch.is_due(self.rounds) {
            let film = world.film(recorder, self)?;
            self.watch.look(&world.error(&film), world.losses(&film, &self.fates).relative);
            self.watch.check_losses(self.task.bounces)?;
        }
        self.submissions = recorder.counts()[1];
        (control.progress)(&self.progress());
        self.end = if self.is_short() {
            Some(End::Time)
        } else if self.rounds == self.task.rounds {
            Some(if self.watch.has_photons(self.emitted) { End::Photons } else { End::Rounds })
        } else {
            let cancelled = control.cancelled.load(Ordering::Relaxed).then_some(End::Cancelled);
            self.watch.end(self.rounds, self.emitted).or(cancelled)
        };
        Ok(self.end.is_some())
    }

    /// Whether what is recorded should run now.
    fn is_due<W: World>(&self, world: &W, recorder: &W::Recorder) -> bool {
        let is_last = self.rounds == self.task.rounds || self.is_short();
        let may_end = self.watch.has_photons(self.emitted) || (self.is_whole() && self.watch.may_end(self.rounds, self.emitted));
        // Tallies are 32-bit on the device.
        let open = self.open.iter().max().copied().unwrap_or(0);
        let tallies_full = open + self.task.photons_per_part > u64::from(u32::MAX);
        // Long work hands commands over by itself, and nobody has looked at the result yet.
        let submitted = recorder.counts()[1] > self.submissions;
        is_last || may_end || tallies_full || submitted || world.is_full(recorder)
    }

    /// Runs what is recorded and counts the fates of its photons. Those of a round that was cut short may still be under way.
    fn collect<W: World>(&mut self, world: &mut W, recorder: &mut W::Recorder, interrupted: bool) -> Result<()> {
        world.collect(recorder, self)?;
        for fates in &mut self.fates {
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

    fn progress(&self) -> Progress {
        let Task { rounds: most_rounds, photons_per_round, counts_photons, .. } = self.task;
        let rounds =
            if self.is_whole() || self.is_short() { f64::from(self.rounds) } else { self.emitted as f64 / photons_per_round as f64 };
        let progress = self.watch.progress(rounds, most_rounds, photons_per_round, sum_of(&self.fates));
        if counts_photons {
            Progress { done: self.emitted, total: photons_per_round * u64::from(most_rounds), ..progress }
        } else {
            progress
        }
    }
}

fn sum_of(fates: &[Fates]) -> Ledger {
    fates.iter().fold(Ledger::default(), |sum, fates| sum.plus(&fates.ledger()))
}

impl Recorder for Commands<'_> {
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.scope("round", body)
    }

    fn started(&self) -> Instant {
        self.started()
    }

    fn counts(&self) -> [u64; 2] {
        [self.dispatch_count(), self.submission_count()]
    }

    fn finish(self) -> Timings {
        self.finish("run")
    }
}

/// The CPU runs everything at once.
impl Recorder for HostClock {
    fn round(&mut self, body: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.time("round", body)
    }

    fn started(&self) -> Instant {
        self.started()
    }

    fn counts(&self) -> [u64; 2] {
        [0; 2]
    }

    fn finish(self) -> Timings {
        self.finish()
    }
}
