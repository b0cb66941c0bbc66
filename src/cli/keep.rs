//! Runs that are kept: checkpoints, shards, and going on with what a file holds.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;

use super::complain;
use super::stop::StopArgs;
use super::values::{parse_seconds, parse_share};
use crate::engine::blocks::Share;
use crate::engine::saved::SavedRun;
use crate::engine::watch::{Keep, Later, SaveRun};
use crate::error::{Error, Result, require};
use crate::output::destination::{Destination, check_not_read, write_synced};
use crate::text::refusal;

#[derive(Args)]
#[command(next_help_heading = "When to stop")]
pub(super) struct KeepArgs {
    /// Write all sums into this file from time to time and at the end, so that --resume can go on with them
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Time between two checkpoints [default: 30s]
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, allow_hyphen_values = true, requires = "checkpoint")]
    every: Option<f64>,
    /// Go on with the blocks of rounds that a checkpoint holds; the result is that of a run without a break, to the bit
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Do every N-th block of rounds, from the K-th on (K from 1 to N); `photonmill merge` adds the checkpoints of all of them
    #[arg(long, value_name = "K/N", value_parser = parse_share, requires = "checkpoint")]
    pub(super) shard: Option<Share>,
}

/// What writes checkpoints and snapshots while a run goes on.
pub(super) struct Keeper<'a> {
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
type Show<'a> = &'a mut dyn FnMut(Later<Arc<SavedRun>>) -> Result<()>;

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

    /// What fails is told of, and does not end the run.
    fn write(&mut self, write: impl FnOnce(&mut W) -> Result<()>) {
        let result = write(&mut self.write);
        if let (Err(error), false) = (&result, self.is_absent) {
            complain(&format!("warning: {error}; the run goes on"));
        }
        self.is_absent = result.is_err();
        self.written = Instant::now();
    }
}

/// Between two checkpoints.
const USUAL_EVERY: f64 = 30.0;

impl KeepArgs {
    /// Fails now where the file could not be written later, or what is to be gone on with cannot be read.
    pub(super) fn open<'a>(&self, stop: &StopArgs) -> Result<Keeper<'a>> {
        let checkpoint = self.checkpoint.as_ref().map(|path| Destination::open_file("--checkpoint", path)).transpose()?;
        let every = self.every.unwrap_or(USUAL_EVERY);
        require((0.001..=1e6).contains(&every), "--every", every, "must be from 1ms to 1000000s")?;
        if let Some(shard) = self.shard {
            stop.check_shard(shard)?;
        }
        let resume = self.resume.as_ref().map(|path| Ok((path.clone(), read("--resume", path)?))).transpose()?;
        let every = Duration::from_secs_f64(every);
        Ok(Keeper {
            checkpoint,
            every,
            resume,
            share: self.shard.unwrap_or_default(),
            snapshot: None,
            display: None,
            written: Instant::now(),
            has_checkpoint: false,
            failed: None,
        })
    }
}

/// A file of a run.
pub(super) fn read(option: &'static str, path: &PathBuf) -> Result<SavedRun> {
    let refuse = |reason: String| Error::setting(option, path.display(), reason);
    let bytes =
        std::fs::read(path).map_err(|error| refuse(format!("cannot be read ({}); name a file of --checkpoint", refusal(&error))))?;
    SavedRun::from_bytes(&bytes).map_err(refuse)
}

impl<'a> Keeper<'a> {
    /// Calls `write` at this interval while the run goes on, but not at its end.
    pub(super) fn set_snapshot(&mut self, every: Duration, write: Write<'a>) {
        self.snapshot = Some(Snapshot::new(every, write));
    }

    /// The same for what need not wait for the picture.
    pub(super) fn set_display(&mut self, every: Duration, show: Show<'a>) {
        self.display = Some(Snapshot::new(every, show));
    }

    /// Refuses outputs in files that are read. A checkpoint may take the place of the one that the run goes on with.
    pub(super) fn check_not_read<'b>(&self, outputs: &[Destination], inputs: impl IntoIterator<Item = &'b Path>) -> Result<()> {
        let others: Vec<Destination> = outputs.iter().filter(|output| Some(*output) != self.checkpoint.as_ref()).cloned().collect();
        check_not_read(outputs, inputs)?;
        check_not_read(&others, self.resume.iter().map(|(path, _)| path.as_path()))
    }

    /// Of the run that is gone on with, whose blocks have so many.
    pub(super) fn rounds_done(&self, block: u32) -> u32 {
        self.resume.as_ref().map_or(0, |(_, run)| run.done.count() * block)
    }

    /// The run that is gone on with.
    pub(super) fn resumed(&self) -> Option<&SavedRun> {
        self.resume.as_ref().map(|(_, run)| run)
    }

    pub(super) fn destinations(&self) -> Vec<Destination> {
        self.checkpoint.iter().cloned().collect()
    }

    /// For a run on a scene of this name.
    pub(super) fn keep<'b>(&'b mut self, scene: &'b str) -> Keep<'b> {
        let of_checkpoint = self.checkpoint.as_ref().map(|_| self.every);
        let of_pictures = [self.snapshot.as_ref().map(|snapshot| snapshot.every), self.display.as_ref().map(|display| display.every)];
        let every = of_pictures.into_iter().chain([of_checkpoint]).flatten().min();
        let (share, resume) = (self.share, self.resume.take());
        Keep { scene, share, resume, every: every.unwrap_or_default(), save: every.map(|_| self as &mut dyn SaveRun), dealt: None }
    }

    /// Fails where the last checkpoint is not there; says so where there is none, as no block of rounds was done.
    pub(super) fn finish(self) -> Result<()> {
        if let Some(file) = self.checkpoint.filter(|_| !self.has_checkpoint && self.failed.is_none()) {
            complain(&format!("warning: --checkpoint {}: is not written, as no block of rounds was done", file.path().display()));
        }
        self.failed.map_or(Ok(()), Err)
    }
}

impl SaveRun for Keeper<'_> {
    /// Writes what is due. A checkpoint that cannot be written is told of, and does not end the run.
    fn save(&mut self, run: &Arc<SavedRun>, is_last: bool) -> Result<()> {
        if let Some(file) = self.checkpoint.as_ref().filter(|_| is_last || self.written.elapsed() >= self.every) {
            let result = write_synced(file, &run.to_bytes());
            if let (Err(error), false, None) = (&result, is_last, &self.failed) {
                complain(&format!("warning: {error}; the run goes on"));
            }
            self.has_checkpoint |= result.is_ok();
            self.failed = result.err();
            self.written = Instant::now();
        }
        if let Some(snapshot) = self.snapshot.as_mut().filter(|snapshot| !is_last && snapshot.is_due()) {
            snapshot.write(|write| write(run));
        }
        if let Some(display) = self.display.as_mut().filter(|display| !is_last && display.is_due()) {
            let run = run.clone();
            display.write(|show| show(Box::new(|| run)));
        }
        Ok(())
    }

    /// What is only shown the run need not wait for.
    fn may_wait(&self) -> bool {
        let is_written = self.checkpoint.is_some() && self.written.elapsed() >= self.every;
        !is_written && !self.snapshot.as_ref().is_some_and(Snapshot::is_due)
    }

    fn save_later(&mut self, run: Later<SavedRun>) -> Result<()> {
        if !self.may_wait() {
            return self.save(&Arc::new(run()), false);
        }
        if let Some(display) = self.display.as_mut().filter(|display| display.is_due()) {
            display.write(|show| show(Box::new(|| Arc::new(run()))));
        }
        Ok(())
    }
}
