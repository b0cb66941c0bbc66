//! The bookkeeping of a run: how far it has come, the fate of every photon, and whether it goes on.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::blocks::{Blocks, Dealer, Share};
use super::saved::{SavedFilm, SavedRun, WorldFilm};
use super::watch::{Control, End, Progress, SaveRun, Watch};
use super::{Recorder, Task, World};
use crate::constants::KEPT_BLOCKS;
use crate::error::{Error, Result};
use crate::ledger::{Fates, Ledger};
use crate::text::counted;

/// How far a run has come, and whether it goes on.
pub(crate) struct RunState<'a, Film> {
    pub(super) task: Task<'a, Film>,
    pub(super) watch: Watch,
    /// Of each map in whole blocks, and in the block under way, as far as they are collected.
    fates_of_blocks: Vec<Fates>,
    fates_of_rest: Vec<Fates>,
    /// Photons of each map that were handed out since, and those of them that whole blocks have.
    open: Vec<u64>,
    open_of_blocks: Vec<u64>,
    /// Photons handed out, and those of whole blocks.
    pub(super) emitted: u64,
    pub(super) emitted_of_blocks: u64,
    /// Blocks that are done, the number of the one under way, and rounds of it that have ended.
    pub done: Blocks,
    block: u32,
    rounds_of_block: u32,
    /// Of the blocks of which the film keeps more, the latest number by its place.
    pub kept: BTreeMap<u32, u32>,
    share: Share,
    /// Where blocks come from that several devices share, and whether what is done must be handed over before the next one.
    dealt: Option<(Arc<Dealer>, usize)>,
    pub(super) hands_over: bool,
    /// When the run was saved last.
    saved: Instant,
    /// How long that took.
    saving: Duration,
    /// Submissions at the latest look.
    submissions: u64,
    pub(super) end: Option<End>,
}

/// What nobody needs at once is made so many times as long after the one before as that took: of the run's time it takes 2 %.
const WAITS: u32 = 50;

impl<'a, Film: WorldFilm> RunState<'a, Film> {
    /// Goes on with what was saved, if anything was.
    pub(super) fn new(task: Task<'a, Film>, recorder: &impl Recorder, control: &mut Control) -> Result<RunState<'a, Film>> {
        let share = control.checkpointing.share;
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
            dealt: control.checkpointing.dealt.take(),
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
        if let Some((_, saved)) = control.checkpointing.resume.take() {
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
    pub(super) fn to_be_saved(&self) -> impl FnOnce(SavedFilm) -> SavedRun + Send + use<Film> {
        let identity = self.task.identity.clone().expect("what is kept has an identity");
        let (share, wanted, sensor) = (self.share, self.wanted(), self.task.sensor);
        let (done, fates) = (self.done.clone(), self.fates_of_blocks.clone());
        move |film| SavedRun { identity, share, wanted, done, sensor, fates, film }
    }

    /// When the run's time is up.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.watch.deadline()
    }

    /// Whole blocks.
    pub(crate) fn blocks(&self) -> u32 {
        self.done.count()
    }

    /// Rounds that have ended.
    pub(crate) fn rounds(&self) -> u32 {
        self.blocks() * self.task.rounds_per_block + self.rounds_of_block
    }

    /// The number of the round under way.
    pub(crate) fn round(&self) -> u32 {
        self.block * self.task.rounds_per_block + self.rounds_of_block
    }

    /// Whether the round under way is the last of its block.
    pub(crate) fn ends_block(&self) -> bool {
        self.rounds_of_block + 1 == self.task.rounds_per_block
    }

    /// So many photons of a map are handed out.
    pub(crate) fn hand_out(&mut self, map: usize, photons: u32) {
        self.open[map] += u64::from(photons);
        self.emitted += u64::from(photons);
    }

    /// Counts the fates of all photons of a map that were handed out, and of those of whole blocks among them.
    pub(crate) fn count(&mut self, map: usize, mut all: Fates, mut of_blocks: Fates) {
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
    pub(crate) fn fates(&self) -> &[Fates] {
        if self.blocks() > 0 { &self.fates_of_blocks } else { &self.fates_of_rest }
    }

    /// Of all photons that were counted, those under way among them.
    pub(crate) fn ledger(&self) -> Ledger {
        sum_of(&self.fates_of_blocks).plus(&sum_of(&self.fates_of_rest))
    }

    /// Photons that the film is of.
    pub(crate) fn emitted(&self) -> u64 {
        if self.blocks() > 0 { self.emitted_of_blocks } else { self.emitted }
    }

    pub(super) fn end_round<W: World<Film = Film>>(&mut self, world: &mut W, recorder: &mut W::Recorder) -> Result<()> {
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
    pub(super) fn pause<W: World<Film = Film>>(
        &mut self,
        world: &mut W,
        recorder: &mut W::Recorder,
        control: &mut Control,
    ) -> Result<bool> {
        let waited = self.saved.elapsed();
        let least = |save: &&mut dyn SaveRun| if save.may_wait() { self.saving * WAITS } else { Duration::ZERO };
        let is_due = self.hands_over || waited >= control.checkpointing.every;
        let saves = self.is_between_blocks() && is_due && control.checkpointing.save.as_ref().is_some_and(|save| waited >= least(save));
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
                self.watch.look((self.task.error)(&made), (self.task.losses)(&made, self.fates()));
                self.watch.check_error(self.task.bounces)?;
                film = Box::new(|| made);
            }
            if let Some(save) = control.checkpointing.save.as_mut().filter(|_| saves) {
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
    fn is_due<W: World<Film = Film>>(&self, world: &W, recorder: &W::Recorder) -> bool {
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
    pub(super) fn collect<W: World<Film = Film>>(&mut self, world: &mut W, recorder: &mut W::Recorder, interrupted: bool) -> Result<()> {
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

    pub(super) fn progress(&self) -> Progress {
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

/// The fates of all maps, added up.
pub(super) fn sum_of(fates: &[Fates]) -> Ledger {
    fates.iter().fold(Ledger::default(), |sum, fates| sum.plus(&fates.ledger()))
}
