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
use crate::engine::watch::{Keep, SaveRun};
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
    snapshot: Option<Snapshot<'a>>,
    /// When each of the two was written last.
    written: [Instant; 2],
    /// Whether there is a checkpoint of this run, and why the latest is not there.
    has_checkpoint: bool,
    failed: Option<Error>,
    /// Whether the latest snapshot could not be written.
    lacks_snapshot: bool,
}

/// A picture of a run that is under way, written again and again.
pub(super) struct Snapshot<'a> {
    pub(super) every: Duration,
    pub(super) write: &'a mut dyn FnMut(&SavedRun) -> Result<()>,
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
        let written = [Instant::now(); 2];
        Ok(Keeper {
            checkpoint,
            every,
            resume,
            share: self.shard.unwrap_or_default(),
            snapshot: None,
            written,
            has_checkpoint: false,
            failed: None,
            lacks_snapshot: false,
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
    pub(super) fn set_snapshot(&mut self, snapshot: Option<Snapshot<'a>>) {
        self.snapshot = snapshot;
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
        let intervals = [self.checkpoint.as_ref().map(|_| self.every), self.snapshot.as_ref().map(|snapshot| snapshot.every)];
        let every = intervals.into_iter().flatten().min();
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
        if let Some(file) = self.checkpoint.as_ref().filter(|_| is_last || self.written[0].elapsed() >= self.every) {
            let result = write_synced(file, &run.to_bytes());
            if let (Err(error), false, None) = (&result, is_last, &self.failed) {
                complain(&format!("warning: {error}; the run goes on"));
            }
            self.has_checkpoint |= result.is_ok();
            self.failed = result.err();
            self.written[0] = Instant::now();
        }
        if let Some(snapshot) = self.snapshot.as_mut().filter(|snapshot| !is_last && self.written[1].elapsed() >= snapshot.every) {
            let result = (snapshot.write)(run);
            if let (Err(error), false) = (&result, self.lacks_snapshot) {
                complain(&format!("warning: {error}; the run goes on"));
            }
            self.lacks_snapshot = result.is_err();
            self.written[1] = Instant::now();
        }
        Ok(())
    }
}
