//! A run to its end, on one device or several, whatever becomes of the devices: one that is lost is opened anew, and one whose memory is
//! full goes on with less; where that is of no use it is given up, and the others go on. All of them go on from the last look
//! ([`super::several_devices`]); one device alone, from what it has noted of itself.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::identity::Identity;
use super::saved::{SavedRun, WorldFilm};
use super::several_devices::{GroupEnd, NOTED_EVERY, RunOnOne, Together};
use super::watch::{Checkpointing, Control, Lazy, SaveRun};
use super::{RunResult, Task};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::settings::stop::Stop;

/// What is done about a device that failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Remedy {
    OpenedAnew,
    LessMemory,
    GivenUp,
}

/// What became of a device that failed, in words.
pub(crate) fn in_words(gpu: &Gpu, error: &Error, remedy: Remedy) -> String {
    let facts = gpu.facts();
    let what = match remedy {
        Remedy::OpenedAnew => "was opened anew, and the run goes on".to_owned(),
        Remedy::LessMemory => format!("goes on in smaller pieces, with {} MiB at most", facts.usable_memory_bytes >> 20),
        Remedy::GivenUp => "is given up, and the others go on".to_owned(),
    };
    format!("{} {what}: {}", facts.label(), error.what())
}

/// Called when a device fails: which one, why, and what is done about it.
pub(crate) type Failed<'a> = &'a dyn Fn(&Gpu, &Error, Remedy);

/// A device that fails more often without having done anything in between is not worth it.
const MOST_FAILURES: u32 = 4;

/// Makes a device that failed fit for the same work; `None` where that cannot be.
fn mend(gpu: &mut Gpu, error: &Error) -> Option<Remedy> {
    match error {
        Error::DeviceLost { .. } => gpu.reopen().is_ok().then_some(Remedy::OpenedAnew),
        Error::OutOfMemory { .. } => gpu.use_less_memory().then_some(Remedy::LessMemory),
        _ => None,
    }
}

/// Retries what can be done again from its start until a device succeeds.
pub(crate) fn until_done<T>(gpu: &mut Gpu, failed: Failed, mut work: impl FnMut(&Gpu) -> Result<T>) -> Result<T> {
    for failures in 1.. {
        let error = match work(gpu) {
            Err(error) if failures <= MOST_FAILURES => error,
            done => return done,
        };
        let Some(remedy) = mend(gpu, &error) else { return Err(error) };
        failed(gpu, &error, remedy);
    }
    unreachable!("failures are counted")
}

/// Notes a run on one device in memory, and hands it on to whoever keeps it.
struct Notes<'a> {
    outer: Option<&'a mut dyn SaveRun>,
    wants_identity: bool,
    latest: Option<Arc<SavedRun>>,
    /// When that was.
    noted: Instant,
}

impl SaveRun for Notes<'_> {
    fn wants_identity(&self) -> bool {
        self.wants_identity
    }

    fn begins(&mut self, identity: &Identity) {
        self.outer.iter_mut().for_each(|outer| outer.begins(identity));
    }

    fn save(&mut self, run: &Arc<SavedRun>, is_last: bool) -> Result<()> {
        self.latest = (!is_last).then(|| run.clone());
        self.noted = Instant::now();
        self.outer.iter_mut().try_for_each(|outer| outer.save(run, is_last))
    }

    fn may_wait(&self) -> bool {
        self.noted.elapsed() < NOTED_EVERY && self.outer.as_ref().is_some_and(|outer| outer.may_wait())
    }

    fn save_later(&mut self, run: Lazy<SavedRun>) -> Result<()> {
        match &mut self.outer {
            Some(outer) if self.noted.elapsed() < NOTED_EVERY && outer.may_wait() => outer.save_later(run),
            _ => self.save(&Arc::new(run()), false),
        }
    }
}

/// Does a task on one device or several to its end.
pub(crate) fn run_on<Plan, Film>(
    gpus: &mut Vec<Gpu>,
    task: &Task<Film>,
    run: &RunOnOne<Plan, Film>,
    failed: Failed,
    control: &mut Control,
) -> Result<RunResult<Plan, Film>>
where
    Plan: Send,
    Film: WorldFilm,
{
    let blocks = task.rounds.div_ceil(task.rounds_per_block);
    let started = Instant::now();
    // Another scene's file is to be refused; what was noted of this run is known to be its own.
    let wants_identity = control.checkpointing.save.is_some() || control.checkpointing.resume.is_some();
    let is_shared = control.checkpointing.share.count(blocks) > 1;
    let mut base = control.checkpointing.resume.take();
    let mut failures = 0;
    loop {
        let resumed = base.clone();
        let outcome = if is_shared && gpus.len() > 1 {
            Together { task, run, started, blocks }.run(gpus, base, control)?
        } else {
            let seconds = task.stop.seconds.map(|seconds| (seconds - started.elapsed().as_secs_f64()).max(0.0));
            let stop = Stop { seconds, ..task.stop };
            alone(|control| run(&gpus[0], stop, control), base, is_shared && task.can_go_on, wants_identity, control)
        };
        let (device, error, so_far) = match outcome {
            GroupEnd::Ended(result) => return Ok(*result),
            GroupEnd::Failed { device, error, base } => (device, error, base),
        };
        let count = |run: &SavedRun| run.done.count();
        let is_further = so_far.as_deref().map_or(0, count) > resumed.as_ref().map_or(0, |(_, run)| count(run));
        failures = if is_further { 1 } else { failures + 1 };
        let file = resumed.as_ref().map(|(path, _)| path.clone()).unwrap_or_default();
        base = so_far.map(|run| (file, Arc::unwrap_or_clone(run))).or(resumed);
        let remedy = if failures > MOST_FAILURES { None } else { mend(&mut gpus[device], &error) };
        if remedy.is_none() && gpus.len() == 1 {
            if let (Some(save), Some((_, run))) = (control.checkpointing.save.as_mut(), base) {
                save.save(&Arc::new(run), true)?;
            }
            return Err(error);
        }
        failed(&gpus[device], &error, remedy.unwrap_or(Remedy::GivenUp));
        if remedy.is_none() {
            gpus.remove(device);
            failures = 0;
        }
    }
}

/// Runs on one device.
fn alone<Plan, Film>(
    run: impl FnOnce(&mut Control) -> Result<RunResult<Plan, Film>>,
    resume: Option<(PathBuf, SavedRun)>,
    notes_itself: bool,
    wants_identity: bool,
    control: &mut Control,
) -> GroupEnd<Plan, Film> {
    let Checkpointing { scene, share, every, save, .. } = &mut control.checkpointing;
    let every = if save.is_some() { (*every).min(NOTED_EVERY) } else { NOTED_EVERY };
    let is_used = notes_itself || save.is_some();
    let mut notes =
        Notes { outer: save.as_mut().map(|save| &mut **save as &mut dyn SaveRun), wants_identity, latest: None, noted: Instant::now() };
    let save = is_used.then_some(&mut notes as &mut dyn SaveRun);
    let checkpointing = Checkpointing { scene, share: *share, resume, every, save, dealt: None };
    match run(&mut Control { cancelled: control.cancelled, progress: &mut *control.progress, checkpointing }) {
        Ok(result) => GroupEnd::Ended(Box::new(result)),
        Err(error) => GroupEnd::Failed { device: 0, error, base: notes.latest },
    }
}
