//! Checkpoints, shards and going on with what a file holds; snapshots of a run that is under way.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::events::{Event, Observer, Report};
use super::request::RenderRequest;
use super::values::Seconds;
use crate::engine::run::blocks::Share;
use crate::engine::run::saved::SavedRun;
use crate::engine::run::watch::{Checkpointing, Lazy, SaveRun};
use crate::error::{Error, Result, require};
use crate::output::destination::{Destination, check_not_read, write_synced};
use crate::text::refusal;

/// What writes checkpoints and snapshots while a run goes on.
pub(crate) struct Checkpoints<'a> {
    report: Report<'a>,
    checkpoint: Option<Destination>,
    every: Duration,
    resume: Option<(PathBuf, SavedRun)>,
    share: Share,
    snapshot: Option<Snapshot<Write<'a>>>,
    display: Option<Snapshot<Show<'a>>>,
    /// When the checkpoint was written last.
    written: Instant,
    /// Whether there is a checkpoint of this run, and why the latest is not there.
    has_checkpoint: bool,
    failed: Option<Error>,
}

/// Writes the picture of a run that is under way.
type Write<'a> = &'a mut dyn FnMut(&SavedRun) -> Result<()>;
/// Shows it, beside the run that goes on.
type Show<'a> = &'a mut dyn FnMut(Lazy<Arc<SavedRun>>) -> Result<()>;

/// What happens again and again.
struct Snapshot<W> {
    every: Duration,
    write: W,
    written: Instant,
    /// Whether the latest could not be written.
    is_absent: bool,
}

impl<W> Snapshot<W> {
    fn new(every: Duration, write: W) -> Snapshot<W> {
        Snapshot { every, write, written: Instant::now(), is_absent: false }
    }

    fn is_due(&self) -> bool {
        self.written.elapsed() >= self.every
    }

    /// What fails is reported, and does not end the run.
    fn write(&mut self, report: Report, write: impl FnOnce(&mut W) -> Result<()>) {
        let result = write(&mut self.write);
        if let (Err(error), false) = (&result, self.is_absent) {
            report(Event::Warning(&format!("{error}; the run goes on")));
        }
        self.is_absent = result.is_err();
        self.written = Instant::now();
    }
}

/// Between two checkpoints.
const USUAL_EVERY: f64 = 30.0;

/// Refuses what only all shards together can know.
fn check_shard(request: &RenderRequest) -> Result<()> {
    let &RenderRequest { shard, error, total_photons, bias, .. } = request;
    let Some(shard) = shard else { return Ok(()) };
    let only_merged = "cannot be known to one shard; give `rounds`, leave it out with `shard`, and look at the error of the merge";
    if let Some(error) = error {
        return Err(Error::setting("error", error, only_merged));
    }
    if let Some(photons) = total_photons {
        return Err(Error::setting("total_photons", photons, only_merged));
    }
    require(!bias, "shard", shard, "cannot be measured with `bias`; leave `bias` out")
}

/// A file of a run.
pub(crate) fn read(option: &'static str, path: &PathBuf) -> Result<SavedRun> {
    let refuse = |reason: String| Error::setting(option, path.display(), reason);
    let bytes =
        std::fs::read(path).map_err(|error| refuse(format!("cannot be read ({}); name a file of `checkpoint`", refusal(&error))))?;
    SavedRun::from_bytes(&bytes).map_err(refuse)
}

impl<'a> Checkpoints<'a> {
    /// What a request asks for, if anything. Fails now where the file could not be written later, or what is to be gone on with cannot be
    /// read.
    pub(crate) fn open(request: &RenderRequest, observer: &Observer<'a>) -> Result<Checkpoints<'a>> {
        check_shard(request)?;
        let checkpoint = request.checkpoint.as_ref().map(|path| Destination::open_file("checkpoint", path)).transpose()?;
        let every = request.every.map_or(USUAL_EVERY, |Seconds(seconds)| seconds);
        require((0.001..=1e6).contains(&every), "every", every, "must be from 1ms to 1000000s")?;
        let resume = request.resume.as_ref().map(|path| Ok((path.clone(), read("resume", path)?))).transpose()?;
        Ok(Checkpoints {
            report: observer.report,
            checkpoint,
            every: Duration::from_secs_f64(every),
            resume,
            share: request.shard.unwrap_or_default(),
            snapshot: None,
            display: None,
            written: Instant::now(),
            has_checkpoint: false,
            failed: None,
        })
    }

    /// Calls `write` at this interval while the run goes on, but not at its end.
    pub(crate) fn set_snapshot(&mut self, every: Duration, write: Write<'a>) {
        self.snapshot = Some(Snapshot::new(every, write));
    }

    /// The same for what need not wait for the picture.
    pub(crate) fn set_display(&mut self, every: Duration, show: Show<'a>) {
        self.display = Some(Snapshot::new(every, show));
    }

    /// Refuses outputs in files that are read. A checkpoint may take the place of the one that the run goes on with.
    pub(crate) fn check_not_read<'b>(&self, outputs: &[Destination], inputs: impl IntoIterator<Item = &'b Path>) -> Result<()> {
        let others: Vec<Destination> = outputs.iter().filter(|output| Some(*output) != self.checkpoint.as_ref()).cloned().collect();
        check_not_read(outputs, inputs)?;
        check_not_read(&others, self.resume.iter().map(|(path, _)| path.as_path()))
    }

    /// Of the run that is gone on with, whose blocks have so many.
    pub(crate) fn rounds_done(&self, block: u32) -> u32 {
        self.resume.as_ref().map_or(0, |(_, run)| run.done.count() * block)
    }

    /// The run that is gone on with.
    pub(crate) fn resumed(&self) -> Option<&SavedRun> {
        self.resume.as_ref().map(|(_, run)| run)
    }

    pub(crate) fn destinations(&self) -> Vec<Destination> {
        self.checkpoint.iter().cloned().collect()
    }

    /// For a run on a scene of this name.
    pub(crate) fn checkpointing<'b>(&'b mut self, scene: &'b str) -> Checkpointing<'b> {
        let of_checkpoint = self.checkpoint.as_ref().map(|_| self.every);
        let of_pictures = [self.snapshot.as_ref().map(|snapshot| snapshot.every), self.display.as_ref().map(|display| display.every)];
        let every = of_pictures.into_iter().chain([of_checkpoint]).flatten().min();
        let (share, resume) = (self.share, self.resume.take());
        Checkpointing { scene, share, resume, every: every.unwrap_or_default(), save: every.map(|_| self as &mut dyn SaveRun), dealt: None }
    }

    /// Fails where the last checkpoint is not there; says so where there is none, as no block of rounds was done.
    pub(crate) fn finish(self) -> Result<()> {
        if let Some(file) = self.checkpoint.filter(|_| !self.has_checkpoint && self.failed.is_none()) {
            let path = file.path().display();
            (self.report)(Event::Warning(&format!("`checkpoint` {path}: is not written, as no block of rounds was done")));
        }
        self.failed.map_or(Ok(()), Err)
    }
}

impl SaveRun for Checkpoints<'_> {
    /// Writes what is due. A checkpoint that cannot be written is reported, and does not end the run.
    fn save(&mut self, run: &Arc<SavedRun>, is_last: bool) -> Result<()> {
        if let Some(file) = self.checkpoint.as_ref().filter(|_| is_last || self.written.elapsed() >= self.every) {
            let result = write_synced(file, &run.to_bytes());
            if let (Err(error), false, None) = (&result, is_last, &self.failed) {
                (self.report)(Event::Warning(&format!("{error}; the run goes on")));
            }
            self.has_checkpoint |= result.is_ok();
            self.failed = result.err();
            self.written = Instant::now();
        }
        if let Some(snapshot) = self.snapshot.as_mut().filter(|snapshot| !is_last && snapshot.is_due()) {
            snapshot.write(self.report, |write| write(run));
        }
        if let Some(display) = self.display.as_mut().filter(|display| !is_last && display.is_due()) {
            let run = run.clone();
            display.write(self.report, |show| show(Box::new(|| run)));
        }
        Ok(())
    }

    /// What is only shown the run need not wait for.
    fn may_wait(&self) -> bool {
        let is_written = self.checkpoint.is_some() && self.written.elapsed() >= self.every;
        !is_written && !self.snapshot.as_ref().is_some_and(Snapshot::is_due)
    }

    fn save_later(&mut self, run: Lazy<SavedRun>) -> Result<()> {
        if !self.may_wait() {
            return self.save(&Arc::new(run()), false);
        }
        if let Some(display) = self.display.as_mut().filter(|display| display.is_due()) {
            display.write(self.report, |show| show(Box::new(|| Arc::new(run()))));
        }
        Ok(())
    }
}
