//! The one loop over rounds, of every run: until something ends it, with the fate of every photon.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::bias::Bias;
use super::blocks::{Blocks, Dealer, Share};
use super::error_bound::FilmError;
use super::identity::Identity;
use super::nonfinite_values::NonfiniteValues;
use super::saved::{SavedFilm, SavedRun};
use super::watch::{Control, End, Later, Progress, SaveRun, Watch};
use crate::constants::KEPT_BLOCKS;
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::{Commands, Constants, DeviceFacts, Gpu, Module};
use crate::ledger::{Fates, Ledger, Losses};
use crate::plan::sensor::Sensor;
use crate::settings::Math;
use crate::settings::stop::Stop;
use crate::text::counted;
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
    /// Those that shared the run with it.
    pub more_devices: Vec<DeviceFacts>,
    pub end: End,
    /// The bias of the radius from extra runs; `None` without these.
    pub bias: Option<Bias>,
    /// Light that limits kept from the result.
    pub losses: Losses,
    /// Photons of a block that was cut short: they are in neither the film nor its errors nor the fates.
    pub left_out: u64,
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
    /// Of a run that is kept.
    pub identity: Option<Identity>,
    /// `None` for the paper's box.
    pub sensor: Option<Sensor>,
    pub stop: Stop,
    /// How fast the radius shrinks; 1 keeps it.
    pub alpha: f64,
    pub rounds: u32,
    pub rounds_per_block: u32,
    pub bounces: u32,
    /// Of all maps.
    pub photons_per_round: u64,
    /// Parts of a round after each of which a run may end.
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
    type Film: Clone + Into<SavedFilm> + Send + 'static;

    /// Records a part of the round under way, and tells `state` of its photons. Fails with [`Error::Interrupted`] where the round
    /// was cut short and nothing of it counts.
    fn trace(&mut self, recorder: &mut Self::Recorder, state: &mut RunState, part: u32) -> Result<()>;
    /// The round that was recorded is the last of its block: notes what counts of it, as what follows may be cut short.
    fn end_block(&mut self, recorder: &mut Self::Recorder, state: &RunState) -> Result<()>;
    /// Whether what is recorded must run now, as there is no room for another part, or it would take long.
    fn is_full(&self, recorder: &Self::Recorder) -> bool;
    /// Runs what is recorded and counts the fates of its photons.
    fn collect(&mut self, recorder: &mut Self::Recorder, state: &mut RunState) -> Result<()>;
    /// What all whole blocks have left, or where there is none, all photons so far. It is copied from the device, and made of the copies
    /// when it is wanted, by whom it may be.
    fn film(&mut self, recorder: &mut Self::Recorder, state: &RunState) -> Result<Later<Self::Film>>;
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
    /// Of each map in whole blocks, and in the block under way, as far as they are collected.
    fates_of_blocks: Vec<Fates>,
    fates_of_rest: Vec<Fates>,
    /// Photons of each map that were handed out since, and those of them that whole blocks have.
    open: Vec<u64>,
    open_of_blocks: Vec<u64>,
    /// Photons handed out, and those of whole blocks.
    emitted: u64,
    emitted_of_blocks: u64,
    /// Blocks that are done, the number of the one under way, and rounds of it that have ended.
    pub done: Blocks,
    block: u32,
    rounds_of_block: u32,
    /// Of the blocks of which the film keeps more, the latest number by its place.
    pub kept: BTreeMap<u32, u32>,
    share: Share,
    /// Where blocks come from that several devices share, and whether what is done must be handed over before the next one.
    dealt: Option<(Arc<Dealer>, usize)>,
    hands_over: bool,
    /// When the run was saved last.
    saved: Instant,
    /// How long that took.
    saving: Duration,
    /// Submissions at the latest look.
    submissions: u64,
    end: Option<End>,
}

/// A run under way: a world that is set up, what its rounds are recorded with, and how far it has come.
pub struct Run<'a, W: World> {
    pub world: W,
    pub recorder: W::Recorder,
    pub state: RunState<'a>,
}

impl<'a, W: World> Run<'a, W> {
    /// Goes on with what was saved, if anything was.
    pub fn new(world: W, recorder: W::Recorder, task: Task<'a>, control: &mut Control) -> Result<Run<'a, W>> {
        let state = RunState::new(task, &recorder, control)?;
        let mut run = Run { world, recorder, state };
        // What was saved may be enough, or have to be handed over.
        let state = &run.state;
        if state.end.is_none() && (state.hands_over || state.watch.may_end(state.blocks(), state.emitted)) {
            run.state.pause(&mut run.world, &mut run.recorder, control)?;
        }
        Ok(run)
    }

    pub fn has_ended(&self) -> bool {
        self.state.end.is_some()
    }

    /// One more round, of a run that has not ended.
    pub fn round(&mut self, control: &mut Control) -> Result<()> {
        let Run { world, recorder, state } = self;
        let mut is_cut = false;
        let round = recorder.round(|recorder| {
            for part in 0..state.task.parts_per_round {
                if part > 0 && state.pause(world, recorder, control)? {
                    is_cut = true;
                    return Ok(());
                }
                world.trace(recorder, state, part)?;
            }
            state.end_round(world, recorder)
        });
        match round {
            // A round cut short is no part of the film; without a first round there is none.
            Err(Error::Interrupted) if state.rounds() > 0 => {
                state.collect(world, recorder, true)?;
                state.end = Some(if control.cancelled.load(Ordering::Relaxed) { End::Cancelled } else { End::Time });
                (control.progress)(&state.progress());
            }
            Err(error) => return Err(error),
            Ok(()) if is_cut => {}
            Ok(()) => {
                state.pause(world, recorder, control)?;
            }
        }
        Ok(())
    }

    /// Runs what is recorded and counts the fates of its photons, as one must who looks at a run between two of its rounds.
    pub fn collect(&mut self) -> Result<()> {
        self.state.collect(&mut self.world, &mut self.recorder, false)
    }

    /// What all whole blocks have left.
    pub fn film(&mut self) -> Result<W::Film> {
        Ok(self.world.film(&mut self.recorder, &self.state)?())
    }

    /// Begins anew from round 0, with a world that knows nothing of the rounds before.
    pub fn begin_anew(&mut self, task: Task<'a>, control: &mut Control) -> Result<()> {
        self.state = RunState::new(task, &self.recorder, control)?;
        Ok(())
    }

    /// What a run that has ended leaves behind.
    fn result<Plan: Clone>(self, plan: &Plan, control: &mut Control) -> Result<RunResult<Plan, W::Film>> {
        let Run { mut world, mut recorder, state } = self;
        let film = world.film(&mut recorder, &state)?();
        if let Some(save) = control.keep.save.as_mut().filter(|_| !state.done.is_empty()) {
            save.save(&Arc::new(state.to_be_saved()(film.clone().into())), true)?;
        }
        let nonfinite_values = world.nonfinite_values(&mut recorder)?;
        let device = state.task.device;
        if let Some((gpu, _)) = device {
            gpu.check_validation()?;
        }
        let [dispatches, submissions] = recorder.counts();
        Ok(RunResult {
            losses: world.losses(&film, state.fates()),
            film,
            left_out: if state.blocks() > 0 { state.emitted - state.emitted_of_blocks } else { 0 },
            fates: state.fates().to_vec(),
            device: device.map(|(gpu, _)| gpu.facts().clone()),
            more_devices: Vec::new(),
            end: state.end.expect("the run has ended"),
            bias: None,
            dispatches,
            submissions,
            pipelines: device.map_or(0, |(gpu, before)| gpu.work().pipelines - before),
            nonfinite_values,
            timings: recorder.finish(),
            plan: plan.clone(),
        })
    }
}

/// Runs a world that is set up to its end.
pub fn run<W: World, Plan: Clone>(
    world: W,
    recorder: W::Recorder,
    plan: &Plan,
    task: Task,
    control: &mut Control,
) -> Result<RunResult<Plan, W::Film>> {
    let mut run = Run::new(world, recorder, task, control)?;
    while !run.has_ended() {
        run.round(control)?;
    }
    run.result(plan, control)
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
    let pipelines_before = gpu.work().pipelines;
    gpu.prepare(modules, &constants)?;
    let mut commands = Commands::new(gpu, constants, started)?;
    commands.timings().count("run");
    Ok((commands, pipelines_before))
}

/// What nobody needs at once is made so many times as long after the one before as that took: of the run's time it takes 2 %.
const WAITS: u32 = 50;

impl<'a> RunState<'a> {
    /// Goes on with what was saved, if anything was.
    fn new(task: Task<'a>, recorder: &impl Recorder, control: &mut Control) -> Result<RunState<'a>> {
        let share = control.keep.share;
        let mut state = RunState {
            watch: Watch::new(task.stop, task.alpha, task.rounds_per_block, Instant::now()),
            fates_of_blocks: task.fates.clone(),
            fates_of_rest: task.fates.clone(),
            open: vec![0; task.fates.len()],
            open_of_blocks: vec![0; task.fates.len()],
            emitted: 0,
            emitted_of_blocks: 0,
            done: Blocks::default(),
            block: 0,
            rounds_of_block: 0,
            kept: BTreeMap::new(),
            share,
            dealt: control.keep.dealt.take(),
            hands_over: false,
            saved: Instant::now(),
            saving: Duration::ZERO,
            submissions: recorder.counts()[1],
            end: None,
            task,
        };
        if share.count(state.wanted()) == 0 {
            let allowed = format!(
                "has nothing to do: the run has {} in all; ask for more `rounds`, or for fewer shards",
                counted(state.wanted(), "block")
            );
            return Err(Error::setting("shard", share, allowed));
        }
        if let Some((_, saved)) = control.keep.resume.take() {
            state.emitted = saved.fates.iter().map(|fates| fates.emitted).sum();
            state.emitted_of_blocks = state.emitted;
            state.kept = saved.film.latest().iter().map(|block| (block.number % KEPT_BLOCKS, block.number)).collect();
            (state.fates_of_blocks, state.done) = (saved.fates, saved.done);
            state.watch.go_on(state.blocks());
        }
        state.begin_block();
        Ok(state)
    }

    /// Blocks that the run is to have.
    fn wanted(&self) -> u32 {
        self.task.rounds.div_ceil(self.task.rounds_per_block)
    }

    /// Takes the next block that is to be done; without one the run has ended.
    fn begin_block(&mut self) {
        self.rounds_of_block = 0;
        let from = if self.done.contains(self.block) { self.block } else { 0 };
        let next = match &self.dealt {
            Some((dealer, device)) => dealer.next(*device),
            None => self.share.next(from, &self.done, self.wanted()).map(|block| (block, false)),
        };
        match next {
            Some((block, hands_over)) => (self.block, self.hands_over) = (block, hands_over),
            None => self.end = Some(self.end_of_rounds()),
        }
    }

    fn end_of_rounds(&self) -> End {
        if self.watch.has_photons(self.emitted) { End::Photons } else { End::Rounds }
    }

    /// The run as far as whole blocks are done, for its film.
    fn to_be_saved(&self) -> impl FnOnce(SavedFilm) -> SavedRun + Send + use<> {
        let identity = self.task.identity.clone().expect("what is kept has an identity");
        let (share, wanted, sensor) = (self.share, self.wanted(), self.task.sensor);
        let (done, fates) = (self.done.clone(), self.fates_of_blocks.clone());
        move |film| SavedRun { identity, share, wanted, done, sensor, fates, film }
    }

    /// When the run's time is up.
    pub fn deadline(&self) -> Option<Instant> {
        self.watch.deadline()
    }

    /// Whole blocks.
    pub fn blocks(&self) -> u32 {
        self.done.count()
    }

    /// Rounds that have ended.
    pub fn rounds(&self) -> u32 {
        self.blocks() * self.task.rounds_per_block + self.rounds_of_block
    }

    /// The number of the round under way.
    pub fn round(&self) -> u32 {
        self.block * self.task.rounds_per_block + self.rounds_of_block
    }

    /// Whether the round under way is the last of its block.
    pub fn ends_block(&self) -> bool {
        self.rounds_of_block + 1 == self.task.rounds_per_block
    }

    /// So many photons of a map are handed out.
    pub fn hand_out(&mut self, map: usize, photons: u32) {
        self.open[map] += u64::from(photons);
        self.emitted += u64::from(photons);
    }

    /// Counts the fates of all photons of a map that were handed out, and of those of whole blocks among them.
    pub fn count(&mut self, map: usize, mut all: Fates, mut of_blocks: Fates) {
        all.emitted = std::mem::take(&mut self.open[map]);
        of_blocks.emitted = std::mem::take(&mut self.open_of_blocks[map]);
        let rest = &mut self.fates_of_rest[map];
        if of_blocks.emitted == 0 {
            rest.add(&all);
            return;
        }
        // What was under way before has become a part of a whole block.
        all.subtract(&of_blocks);
        let before = std::mem::replace(rest, all);
        self.fates_of_blocks[map].add(&before);
        self.fates_of_blocks[map].add(&of_blocks);
    }

    /// Of the photons that the film is of: of whole blocks, or where there is none, of all.
    pub fn fates(&self) -> &[Fates] {
        if self.blocks() > 0 { &self.fates_of_blocks } else { &self.fates_of_rest }
    }

    /// Of all photons that were counted, those under way among them.
    pub fn ledger(&self) -> Ledger {
        sum_of(&self.fates_of_blocks).plus(&sum_of(&self.fates_of_rest))
    }

    /// Photons that the film is of.
    pub fn emitted(&self) -> u64 {
        if self.blocks() > 0 { self.emitted_of_blocks } else { self.emitted }
    }

    fn end_round<W: World>(&mut self, world: &mut W, recorder: &mut W::Recorder) -> Result<()> {
        if self.ends_block() {
            world.end_block(recorder, self)?;
            let latest = self.kept.entry(self.block % KEPT_BLOCKS).or_insert(self.block);
            *latest = self.block.max(*latest);
            self.open_of_blocks.copy_from_slice(&self.open);
            self.emitted_of_blocks = self.emitted;
            self.done.insert(self.block);
            self.begin_block();
        } else {
            self.rounds_of_block += 1;
            // A run of less than a block.
            if self.rounds() == self.task.rounds {
                self.end = Some(self.end_of_rounds());
            }
        }
        Ok(())
    }

    /// Whether the run is between two rounds.
    fn is_whole(&self) -> bool {
        self.emitted == u64::from(self.rounds()) * self.task.photons_per_round
    }

    /// Whether it is between two blocks.
    fn is_between_blocks(&self) -> bool {
        self.is_whole() && self.rounds_of_block == 0
    }

    /// Whether the time was up in the first round, so that it ended with the photons that it had.
    fn is_short(&self) -> bool {
        self.emitted < u64::from(self.rounds()) * self.task.photons_per_round
    }

    /// Runs what is recorded where that is due, looks at it, and says whether the run ends.
    fn pause<W: World>(&mut self, world: &mut W, recorder: &mut W::Recorder, control: &mut Control) -> Result<bool> {
        let waited = self.saved.elapsed();
        let least = |save: &&mut dyn SaveRun| if save.may_wait() { self.saving * WAITS } else { Duration::ZERO };
        let is_due = self.hands_over || waited >= control.keep.every;
        let saves = self.is_between_blocks() && is_due && control.keep.save.as_ref().is_some_and(|save| waited >= least(save));
        if !saves && !self.is_due(world, recorder) {
            return Ok(self.end.is_some());
        }
        self.collect(world, recorder, false)?;
        let began = Instant::now();
        let whole = self.is_between_blocks();
        let looks = whole && self.dealt.is_none() && self.watch.is_due(self.blocks());
        if looks || saves {
            let mut film = world.film(recorder, self)?;
            if looks {
                let made = film();
                self.watch.look(&world.error(&made), &world.losses(&made, self.fates()));
                self.watch.check_error(self.task.bounces)?;
                film = Box::new(|| made);
            }
            if let Some(save) = control.keep.save.as_mut().filter(|_| saves) {
                let saved_run = self.to_be_saved();
                save.save_later(Box::new(move || saved_run(film().into())))?;
                self.saved = Instant::now();
                self.saving = self.saved - began;
                self.hands_over = false;
            }
        }
        self.submissions = recorder.counts()[1];
        (control.progress)(&self.progress());
        self.end = if self.is_short() {
            Some(End::Time)
        } else if self.end.is_some() {
            self.end
        } else {
            let cancelled = control.cancelled.load(Ordering::Relaxed).then_some(End::Cancelled);
            let done = if whole { self.watch.end(self.blocks(), self.emitted) } else { None };
            done.or(self.watch.is_late().then_some(End::Time)).or(cancelled)
        };
        Ok(self.end.is_some())
    }

    /// Whether what is recorded should run now.
    fn is_due<W: World>(&self, world: &W, recorder: &W::Recorder) -> bool {
        let is_last = self.end.is_some() || self.is_short();
        let may_end = self.is_between_blocks() && self.watch.may_end(self.blocks(), self.emitted);
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
        if interrupted {
            self.fates_of_rest.iter_mut().for_each(Fates::interrupt);
        }
        for fates in self.fates_of_blocks.iter().chain(&self.fates_of_rest) {
            let ledger = fates.ledger();
            if !ledger.closes() || ledger.dropped != 0 {
                return Err(Error::LedgerOpen { ledger });
            }
        }
        Ok(())
    }

    fn progress(&self) -> Progress {
        let Task { rounds_per_block, photons_per_round, counts_photons, .. } = self.task;
        let most_rounds = if self.share.of > 1 { self.share.count(self.wanted()) * rounds_per_block } else { self.task.rounds };
        // What is left of a round that was cut short at the end counts for nothing.
        let counts_whole = self.is_whole() || self.is_short() || self.end.is_some();
        let rounds = if counts_whole { f64::from(self.rounds()) } else { self.emitted as f64 / photons_per_round as f64 };
        let progress = self.watch.progress(rounds, most_rounds, photons_per_round, self.ledger());
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
