//! A run on several devices. Each takes the next block when it is done with one, and integer sums make one film of all, to the bits of a
//! run on one device.
//!
//! Whether the run ends is decided where a run on one device would: after so many blocks, in the order in which they were dealt. Before
//! a device takes its first block beyond such a look, it hands over what it has. Once all have, these add up to the blocks before the
//! look and no others; what was done since is left out if the run ends there.
//!
//! One attempt ends when a device fails, with what all had done at the last look; [`super::retry`] makes the next.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::blocks::Dealer;
use super::identity::Identity;
use super::saved::{SavedRun, WorldFilm};
use super::watch::{Checkpointing, Control, End, Lazy, Progress, SaveRun, Watch, looks};
use super::{RunResult, Task};
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::ledger::Ledger;
use crate::settings::stop::Stop;

/// Runs on one device until a goal is reached, or as long as it is dealt blocks.
pub(crate) type RunOnOne<'a, Plan, Film> = dyn Fn(&Gpu, Stop, &mut Control) -> Result<RunResult<Plan, Film>> + Sync + 'a;

/// Between two times at which a run is noted, in memory.
pub(crate) const NOTED_EVERY: Duration = Duration::from_secs(10);

/// What a device says.
enum Event<Plan, Film> {
    Begins(Box<Identity>),
    Progress(Box<Progress>),
    /// What it has done before so many looks.
    Saved(usize, Arc<SavedRun>),
    Ended(Box<Result<RunResult<Plan, Film>>>),
}

/// Hands over what a device has done, in its order, while the device goes on.
struct HandOver<'a, Plan, Film> {
    device: usize,
    dealer: &'a Dealer,
    events: Sender<(usize, Event<Plan, Film>)>,
    /// To who makes what is handed over of the copies, and how many looks it is before.
    later: Sender<(usize, Lazy<SavedRun>)>,
}

impl<Plan, Film> SaveRun for HandOver<'_, Plan, Film> {
    fn begins(&mut self, identity: &Identity) {
        // Nobody listens any more: the run ends anyway.
        let _ = self.events.send((self.device, Event::Begins(Box::new(identity.clone()))));
    }

    fn save(&mut self, run: &Arc<SavedRun>, is_last: bool) -> Result<()> {
        assert!(is_last, "what is under way is saved later");
        let run = SavedRun::clone(run);
        let _ = self.later.send((usize::MAX, Box::new(|| run)));
        Ok(())
    }

    fn save_later(&mut self, run: Lazy<SavedRun>) -> Result<()> {
        let _ = self.later.send((self.dealer.looks_behind(self.device), run));
        Ok(())
    }
}

/// What is known of a device.
struct Known<Plan, Film> {
    identity: Option<Identity>,
    progress: Progress,
    /// What it had done before so many looks, in their order; `None`: nothing.
    saved: Vec<(usize, Option<Arc<SavedRun>>)>,
    result: Option<RunResult<Plan, Film>>,
    is_over: bool,
}

/// How some devices ended together.
pub(crate) enum GroupEnd<Plan, Film> {
    Ended(Box<RunResult<Plan, Film>>),
    /// One failed; the others were stopped. With what all had done at the last look.
    Failed {
        device: usize,
        error: Error,
        base: Option<Arc<SavedRun>>,
    },
}

/// Between two looks at the clock and at what the user wants.
const PAUSE: Duration = Duration::from_millis(20);

/// One attempt.
pub(crate) struct Together<'a, Plan, Film> {
    pub task: &'a Task<'a, Film>,
    pub run: &'a RunOnOne<'a, Plan, Film>,
    pub started: Instant,
    pub blocks: u32,
}

/// How far an attempt has come.
struct Attempt<'a, Plan, Film> {
    devices: Vec<Known<Plan, Film>>,
    dealer: &'a Dealer,
    watch: Watch,
    most_rounds: u32,
    /// The next look.
    look: usize,
    /// All of it at the last look.
    base: Option<Arc<SavedRun>>,
    end: Option<End>,
    /// When it was saved last, and whether it is about to be.
    saved: Instant,
    saves: bool,
    /// Why nothing comes of it: a device that failed, or one that cannot take part.
    failed: Option<(usize, Error)>,
    refused: Option<Error>,
    /// Numbers of the devices, as the user knows them.
    numbers: Vec<usize>,
}

impl<Plan: Send, Film: WorldFilm> Together<'_, Plan, Film> {
    pub(crate) fn run(
        &self,
        gpus: &mut [Gpu],
        resume: Option<(std::path::PathBuf, SavedRun)>,
        control: &mut Control,
    ) -> Result<GroupEnd<Plan, Film>> {
        let Together { task, run, .. } = *self;
        let share = control.checkpointing.share;
        let done = resume.as_ref().map(|(_, run)| run.done.clone()).unwrap_or_default();
        let most = task.stop.photons.map_or(self.blocks, |photons| {
            let of_block = (task.photons_per_round * u64::from(task.rounds_per_block)).max(1);
            photons.div_ceil(of_block).min(u64::from(self.blocks)) as u32
        });
        let mut order: Vec<u32> = (share.number..self.blocks).step_by(share.of as usize).filter(|block| !done.contains(*block)).collect();
        order.truncate(most.saturating_sub(done.count()) as usize);
        let all = order.len() as u32;
        // Nobody looks where no error decides; what is done is noted from time to time all the same.
        let looks = task.stop.error.into_iter().flat_map(|_| looks(done.count())).map(|look| look - done.count());
        let dealer = Arc::new(Dealer::new(order, gpus.len(), looks));
        let cancelled = AtomicBool::new(false);
        let (events, received) = channel();
        let mut attempt = Attempt {
            devices: gpus.iter().map(|_| Known::new()).collect(),
            dealer: &dealer,
            watch: Watch::new(task.stop, task.alpha, task.rounds_per_block, self.started),
            most_rounds: (done.count() + all) * task.rounds_per_block,
            look: 0,
            base: resume.as_ref().map(|(_, run)| Arc::new(run.clone())),
            end: None,
            saved: Instant::now(),
            saves: false,
            failed: None,
            refused: None,
            numbers: gpus.iter().map(|gpu| gpu.facts().index).collect(),
        };
        attempt.watch.go_on(done.count());
        let scene = control.checkpointing.scene;
        let resume = Mutex::new(resume);
        let no_goal = Stop { error: None, seconds: None, photons: None, ..task.stop };
        std::thread::scope(|scope| {
            for (device, gpu) in gpus.iter_mut().enumerate() {
                let (dealer, events, cancelled, resume) = (&dealer, events.clone(), &cancelled, &resume);
                scope.spawn(move || {
                    let (later, copies) = channel::<(usize, Lazy<SavedRun>)>();
                    let saved = events.clone();
                    let maker = scope.spawn(move || {
                        for (looks, make) in copies {
                            let _ = saved.send((device, Event::Saved(looks, Arc::new(make()))));
                        }
                    });
                    let mut hand_over = HandOver { device, dealer, events: events.clone(), later };
                    let report = |progress: &Progress| drop(events.send((device, Event::Progress(Box::new(progress.clone())))));
                    let resume = if device == 0 { resume.lock().unwrap_or_else(PoisonError::into_inner).take() } else { None };
                    let dealt = Some((dealer.clone(), device));
                    let checkpointing = Checkpointing { scene, share, resume, every: Duration::MAX, save: Some(&mut hand_over), dealt };
                    let result = run(gpu, no_goal, &mut Control { cancelled, progress: &mut { report }, checkpointing });
                    // All that was handed over comes before the end.
                    drop(hand_over);
                    maker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                    let _ = events.send((device, Event::Ended(Box::new(result))));
                });
            }
            drop(events);
            self.watch_over(&mut attempt, &received, &cancelled, control)
        })?;
        let base = attempt.base.take();
        if let Some((device, error)) = attempt.failed.take() {
            return Ok(GroupEnd::Failed { device, error, base });
        }
        let run = match attempt.end {
            Some(End::Error) => base,
            _ => attempt.merged(usize::MAX - 1),
        };
        let run = run.filter(|run| !run.done.is_empty()).ok_or(Error::Interrupted)?;
        let is_whole = run.done.count() == done.count() + all;
        let end = match attempt.end {
            Some(End::Error) => End::Error,
            _ if is_whole && task.stop.photons.is_some_and(|photons| run.emitted() >= photons) => End::Photons,
            _ if is_whole => End::Rounds,
            end => end.unwrap_or(End::Cancelled),
        };
        if let Some(save) = control.checkpointing.save.as_mut() {
            save.save(&run, true)?;
        }
        Ok(GroupEnd::Ended(Box::new(self.result(attempt, run, end))))
    }

    /// Until all devices are over.
    fn watch_over(
        &self,
        attempt: &mut Attempt<Plan, Film>,
        received: &Receiver<(usize, Event<Plan, Film>)>,
        cancelled: &AtomicBool,
        control: &mut Control,
    ) -> Result<()> {
        let mut failed = Ok(());
        while attempt.devices.iter().any(|device| !device.is_over) {
            match received.recv_timeout(PAUSE) {
                Ok((device, event)) => attempt.take(device, event),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if let Some(error) = attempt.refused.take() {
                failed = Err(error);
            }
            let is_ending = attempt.end.is_some() || attempt.failed.is_some() || failed.is_err();
            if is_ending {
                if attempt.end != Some(End::Time) || control.cancelled.load(Ordering::Relaxed) {
                    cancelled.store(true, Ordering::Relaxed);
                }
                attempt.dealer.close();
                continue;
            }
            if let Err(error) = self.look(attempt, control) {
                failed = Err(error);
                continue;
            }
            if control.cancelled.load(Ordering::Relaxed) {
                attempt.end = Some(End::Cancelled);
            } else if attempt.watch.is_late() && attempt.dealer.dealt() > 0 {
                // Blocks under way are done, so that none is missing before the last.
                attempt.end = Some(End::Time);
            }
            let every = if control.checkpointing.save.is_some() { control.checkpointing.every.min(NOTED_EVERY) } else { NOTED_EVERY };
            if !attempt.saves && attempt.saved.elapsed() >= every {
                attempt.dealer.look_now();
                attempt.saves = true;
            }
            (control.progress)(&self.progress(attempt));
        }
        failed
    }

    /// Looks as far as all devices have handed over what they had done before.
    fn look(&self, attempt: &mut Attempt<Plan, Film>, control: &mut Control) -> Result<()> {
        while attempt.end.is_none() && attempt.look < attempt.dealer.looks_dealt() && attempt.is_known(attempt.look) {
            let run = attempt.merged(attempt.look);
            attempt.look += 1;
            attempt.forget();
            let Some(run) = run else {
                // Nothing to save yet.
                attempt.saves = false;
                continue;
            };
            let blocks = run.done.count();
            if attempt.watch.is_due(blocks) {
                let film = Film::of(&run.film);
                attempt.watch.look((self.task.error)(film), (self.task.losses)(film, &run.fates));
                attempt.watch.check_error(self.task.bounces)?;
                attempt.end = attempt.watch.end(blocks, 0);
            }
            control.checkpointing.save.iter_mut().try_for_each(|save| save.save(&run, false))?;
            (attempt.saved, attempt.saves) = (Instant::now(), false);
            attempt.base = Some(run);
        }
        Ok(())
    }

    fn progress(&self, attempt: &Attempt<Plan, Film>) -> Progress {
        let all = || attempt.devices.iter().map(|device| &device.progress);
        let rounds: u64 = all().map(|progress| progress.done).sum();
        let ledger = all().fold(Ledger::default(), |sum, progress| sum.plus(&progress.ledger));
        attempt.watch.progress(rounds as f64, attempt.most_rounds, self.task.photons_per_round, ledger)
    }

    /// The result of all, in place of that of the first device.
    fn result(&self, attempt: Attempt<Plan, Film>, run: Arc<SavedRun>, end: End) -> RunResult<Plan, Film> {
        let mut results = attempt.devices.into_iter().filter_map(|device| device.result);
        let mut result = results.next().expect("a device has ended well");
        let mut traced = result.ledger().emitted + result.left_out;
        for other in results {
            traced += other.ledger().emitted + other.left_out;
            result.dispatches += other.dispatches;
            result.submissions += other.submissions;
            result.pipelines += other.pipelines;
            result.timings.join(&other.timings);
            result.nonfinite_values = NonfiniteValues::both(result.nonfinite_values, other.nonfinite_values);
            result.more_devices.extend(other.device);
        }
        let film = Film::of(&run.film).clone();
        RunResult {
            left_out: traced.saturating_sub(run.fates.iter().map(|fates| fates.emitted).sum()),
            losses: (self.task.losses)(&film, &run.fates),
            film,
            fates: run.fates.clone(),
            end,
            ..result
        }
    }
}

impl<Plan, Film> Attempt<'_, Plan, Film> {
    fn take(&mut self, device: usize, event: Event<Plan, Film>) {
        let own = &mut self.devices[device];
        match event {
            Event::Progress(progress) => own.progress = *progress,
            Event::Saved(looks, run) => own.saved.push((looks, Some(run).filter(|run| !run.done.is_empty()))),
            Event::Begins(identity) => {
                own.identity = Some(*identity);
                let known: Vec<&Identity> = self.devices.iter().filter_map(|device| device.identity.as_ref()).collect();
                let difference = known.iter().find_map(|other| known[0].differs_from(other));
                if let Some(difference) = difference {
                    self.refused =
                        Some(Error::setting("devices", self.numbers[device], format!("cannot take part: what it computes {difference}")));
                }
            }
            Event::Ended(result) => {
                own.is_over = true;
                // What it has last stands for all looks that it has not come to.
                if own.saved.last().is_none_or(|(looks, _)| *looks != usize::MAX) {
                    own.saved.push((usize::MAX, None));
                }
                match *result {
                    Ok(result) => own.result = Some(result),
                    // It was stopped before it had anything.
                    Err(Error::Interrupted) => {}
                    Err(error) => drop(self.failed.get_or_insert((device, error))),
                }
            }
        }
    }

    fn is_known(&self, look: usize) -> bool {
        let mut devices = self.devices.iter().enumerate();
        devices.all(|(number, device)| device.at(look).is_some() || self.dealer.has_none_before(number, look))
    }

    /// What all had done before a look, added up.
    fn merged(&self, look: usize) -> Option<Arc<SavedRun>> {
        let mut all: Option<Arc<SavedRun>> = None;
        for run in self.devices.iter().filter_map(|device| device.at(look)?.as_ref()) {
            let Some(sum) = &mut all else {
                all = Some(run.clone());
                continue;
            };
            // Copied where it is known as it is.
            let sum = Arc::make_mut(sum);
            let share = sum.share;
            sum.merge(run).expect("each block is dealt once");
            sum.share = share;
        }
        all
    }

    /// Drops what no later look needs.
    fn forget(&mut self) {
        for device in &mut self.devices {
            device.saved.retain(|(looks, _)| *looks > self.look);
        }
    }
}

impl<Plan, Film> Known<Plan, Film> {
    fn new() -> Known<Plan, Film> {
        Known { identity: None, progress: Progress::default(), saved: Vec::new(), result: None, is_over: false }
    }

    /// What it had done before a look, if that is known.
    fn at(&self, look: usize) -> Option<&Option<Arc<SavedRun>>> {
        self.saved.iter().find(|(looks, _)| *looks > look).map(|(_, run)| run)
    }
}
