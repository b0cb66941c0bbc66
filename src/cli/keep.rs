//! Runs that are kept: checkpoints, shards, and going on with what a file holds.

use std::path::PathBuf;
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
use crate::output::destination::{Destination, write_synced};

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
    /// Why the latest checkpoint is not there.
    failed: Option<Error>,
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
        let checkpoint = self.checkpoint.as_ref().map(|path| Destination::open("--checkpoint", path)).transpose()?;
        if let Some(stream) = checkpoint.as_ref().filter(|file| file.is_standard_output()) {
            return Err(Error::setting("--checkpoint", stream.path().display(), "must be a file, which is written again and again"));
        }
        let every = self.every.unwrap_or(USUAL_EVERY);
        require((0.001..=1e6).contains(&every), "--every", every, "must be from 1ms to 1000000s")?;
        if let Some(shard) = self.shard {
            stop.check_shard(shard)?;
        }
        let resume = self.resume.as_ref().map(|path| Ok((path.clone(), read("--resume", path)?))).transpose()?;
        let every = Duration::from_secs_f64(every);
        let written = [Instant::now(); 2];
        Ok(Keeper { checkpoint, every, resume, share: self.shard.unwrap_or_default(), snapshot: None, written, failed: None })
    }
}

/// A file of a run.
pub(super) fn read(option: &'static str, path: &PathBuf) -> Result<SavedRun> {
    let refuse = |reason: String| Error::setting(option, path.display(), reason);
    let bytes = std::fs::read(path).map_err(|error| refuse(format!("cannot be read ({}); name a file of --checkpoint", error.kind())))?;
    SavedRun::from_bytes(&bytes).map_err(refuse)
}

impl<'a> Keeper<'a> {
    pub(super) fn set_snapshot(&mut self, snapshot: Option<Snapshot<'a>>) {
        self.snapshot = snapshot;
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

    /// Fails where the last checkpoint is not there.
    pub(super) fn finish(self) -> Result<()> {
        self.failed.map_or(Ok(()), Err)
    }
}

impl SaveRun for Keeper<'_> {
    /// Writes what is due. A checkpoint that cannot be written is told of, and does not end the run.
    fn save(&mut self, run: &Arc<SavedRun>, is_last: bool) -> Result<()> {
        if let Some(file) = self.checkpoint.as_ref().filter(|_| is_last || self.written[0].elapsed() >= self.every) {
            let result = write_synced(file, &run.to_bytes());
            if let (Err(error), false) = (&result, is_last) {
                complain(&format!("warning: {error}; the run goes on"));
            }
            self.failed = result.err();
            self.written[0] = Instant::now();
        }
        if let Some(snapshot) = self.snapshot.as_mut().filter(|snapshot| !is_last && self.written[1].elapsed() >= snapshot.every) {
            if let Err(error) = (snapshot.write)(run) {
                complain(&format!("warning: {error}; the run goes on"));
            }
            self.written[1] = Instant::now();
        }
        Ok(())
    }
}
