//! When a run ends before its last round: at an error (`--error`), at a time, or at a number of photons, whichever comes first.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::blocks::{Dealer, Share};
use super::identity::Identity;
use super::saved::SavedRun;
use crate::engine::error::bias::Bias;
use crate::engine::error::bound::{FilmError, bound_of_both, error_bound};
use crate::error::{Error, Result, require};
use crate::ledger::{Ledger, Losses};
use crate::plan::radius::mean_squared_radius;
use crate::settings::stop::{FIRST_LOOK, Stop};
use serde::Serialize;

/// How a caller watches a run and ends it early.
pub(crate) struct Control<'a> {
    /// Set from outside to end the run after the photons, or the round, under way.
    pub cancelled: &'a AtomicBool,
    /// Called from time to time with how far the run has come.
    pub progress: &'a mut dyn FnMut(&Progress),
    pub checkpointing: Checkpointing<'a>,
}

/// Computed on demand.
pub(crate) type Lazy<T> = Box<dyn FnOnce() -> T + Send>;

/// Takes a run as far as whole blocks are done.
pub(crate) trait SaveRun {
    /// Whether it must know what the run computes.
    fn wants_identity(&self) -> bool {
        true
    }

    /// Called once with what the run computes, before its first block.
    fn begins(&mut self, _: &Identity) {}

    /// `is_last`: the run has ended. An error ends it.
    fn save(&mut self, run: &Arc<SavedRun>, is_last: bool) -> Result<()>;

    /// Whether nobody needs the run at once, so that it may be made when there is time for it.
    fn may_wait(&self) -> bool {
        false
    }

    /// The same while the run is under way, which may go on before it is saved.
    fn save_later(&mut self, run: Lazy<SavedRun>) -> Result<()> {
        self.save(&Arc::new(run()), false)
    }
}

/// What of a run is kept, gone on with, and shared.
#[derive(Default)]
pub(crate) struct Checkpointing<'a> {
    /// What the scene is called.
    pub scene: &'a str,
    /// The part of the run that is to be done.
    pub share: Share,
    /// A run of the same identity that this one goes on with, and the name of its file.
    pub resume: Option<(PathBuf, SavedRun)>,
    /// Between two calls of `save`, which is also called at the end.
    pub every: Duration,
    pub save: Option<&'a mut dyn SaveRun>,
    /// Where blocks come from that several devices share, and the number of this one.
    pub dealt: Option<(Arc<Dealer>, usize)>,
}

impl<'a> Control<'a> {
    /// Watches nothing but `cancelled`.
    pub(crate) fn quiet(cancelled: &'a AtomicBool) -> Control<'a> {
        // A closure without captures takes no memory, so none is lost.
        Control { cancelled, progress: Box::leak(Box::new(|_: &Progress| {})), checkpointing: Checkpointing::default() }
    }
}

impl Checkpointing<'_> {
    /// Whether more than the result is asked for.
    pub(crate) fn is_used(&self) -> bool {
        self.save.is_some() || self.resume.is_some() || self.share.of > 1
    }

    /// Whether the first block to be done may be another than block 0.
    pub(crate) fn begins_later(&self) -> bool {
        self.share.number > 0 || self.resume.is_some() || self.dealt.is_some()
    }

    /// The identity of the run, which takes a while to find out, where anybody asks. Fails where the file that it is to go on with is
    /// of another one.
    pub(crate) fn identity(&mut self, of_run: impl FnOnce(&str) -> Identity) -> Result<Option<Identity>> {
        let is_wanted = match (&self.save, &self.resume) {
            (None, None) => return Ok(None),
            (Some(save), _) => save.wants_identity(),
            (None, Some(_)) => true,
        };
        if !is_wanted {
            return Ok(Some(Identity::default()));
        }
        let identity = of_run(self.scene);
        if let Some(save) = &mut self.save {
            save.begins(&identity);
        }
        if let Some((path, saved)) = &self.resume {
            if let Some(difference) = identity.differs_from(&saved.identity) {
                return Err(Error::setting("resume", path.display(), difference));
            }
            let other = format!("is shard {} of its run, and this is {}; give the shard's own file", saved.share, self.share);
            require(saved.share == self.share, "resume", path.display(), other)?;
        }
        Ok(Some(identity))
    }

    /// Fails where the file that the run is to go on with holds other values than its own identity asks for.
    pub(crate) fn check_resumed(&self, holds: impl FnOnce(&SavedRun) -> bool) -> Result<()> {
        let Some((path, saved)) = &self.resume else { return Ok(()) };
        let allowed = "contradicts itself: its settings ask for other values than it holds; begin anew without it";
        require(holds(saved), "resume", path.display(), allowed)
    }
}

/// Lets a run go on to its end.
impl Default for Control<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Control::quiet(&NEVER)
    }
}

/// How far a run has come.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Progress {
    /// Photons emitted, or rounds done, and how many there will be at most.
    pub done: u64,
    pub total: u64,
    /// Wall time since the start, and predicted until the end, seconds.
    pub seconds: f64,
    pub seconds_left: Option<f64>,
    /// Relative error that the result has not more of, with the confidence asked for, and the one that is wanted.
    pub error: Option<f64>,
    pub error_wanted: Option<f64>,
    /// Photons traced so far, of all maps.
    pub photons: u64,
    /// Their fates so far.
    pub ledger: Ledger,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    Rounds,
    Error,
    Time,
    Photons,
    Cancelled,
}

/// Between two looks that decide nothing: each takes a tenth of a second in a picture of 512 x 512.
const LOOK_FOR_PEOPLE: Duration = Duration::from_secs(2);

/// Looks come at numbers of blocks that grow by a quarter, as each is one more chance to stop too early; they are the same in every run.
fn next_look(look: u32) -> u32 {
    look + (look / 4).max(1)
}

/// Numbers of blocks after which the error is looked at, from so many on.
pub(crate) fn looks(blocks: u32) -> impl Iterator<Item = u32> {
    std::iter::successors(Some(FIRST_LOOK), |look| Some(next_look(*look))).skip_while(move |look| *look < blocks)
}

/// Watches a run: how long it has taken, and how large its error still is.
pub(crate) struct Watch {
    stop: Stop,
    /// How fast the radius shrinks (`mean_squared_radius`); 1 keeps it.
    alpha: f64,
    rounds_per_block: u32,
    started: Instant,
    /// In blocks.
    next_look: u32,
    looked: Instant,
    /// The latest look.
    seen: Option<Look>,
}

/// What a film told, with the bound of its noise, and what limits kept from it.
struct Look {
    error: FilmError,
    most_noise: f64,
    losses: Losses,
}

impl Watch {
    /// Of a run that began at `started`.
    pub(crate) fn new(stop: Stop, alpha: f64, rounds_per_block: u32, started: Instant) -> Watch {
        Watch { stop, alpha, rounds_per_block, started, next_look: FIRST_LOOK, looked: started, seen: None }
    }

    /// Looks at no film of fewer blocks: those that were done before have been looked at.
    pub(crate) fn go_on(&mut self, blocks: u32) {
        self.next_look = looks(blocks).next().expect("looks have no end");
    }

    /// Whether the film should be read after so many blocks.
    pub(crate) fn is_due(&self, blocks: u32) -> bool {
        // Where no error ends the run, people look, and need not do so often.
        let is_wanted = self.stop.error.is_some() || self.looked.elapsed() >= LOOK_FOR_PEOPLE;
        blocks >= self.next_look && is_wanted
    }

    /// Whether the run must be looked at now, as it may have done enough.
    pub(crate) fn may_end(&self, blocks: u32, photons: u64) -> bool {
        (self.stop.error.is_some() && self.is_due(blocks)) || self.has_photons(photons)
    }

    /// When the run's time is up.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.stop.seconds.map(|seconds| self.started + Duration::from_secs_f64(seconds))
    }

    /// Takes what a film shows, and what limits kept from it.
    pub(crate) fn look(&mut self, error: FilmError, losses: Losses) {
        self.next_look = next_look(error.blocks);
        self.looked = Instant::now();
        self.seen = Some(Look { most_noise: error_bound(error.noise, error.freedom, self.stop.confidence), error, losses });
    }

    /// Noise, bias, what is unknown and what is unseen together at the latest look.
    fn error(&self) -> Option<(u32, f64)> {
        self.seen.as_ref().map(|look| {
            let Look { error: FilmError { rounds, noise, unknown, unseen, .. }, most_noise, losses } = look;
            let bias = self.bias(look, f64::from(*rounds)).map(|bias| bias + losses.relative);
            (*rounds, bound_of_both([*noise, *most_noise], bias).hypot(unknown.relative).hypot(*unseen))
        })
    }

    /// Refuses an error that cannot be reached, and that nothing else would end: where limits alone keep more light from the result, or
    /// the bias of a radius that never shrinks is more.
    pub(crate) fn check_error(&self, bounces: u32) -> Result<()> {
        if self.stop.seconds.is_some() || self.stop.photons.is_some() {
            return Ok(());
        }
        let (Some(wanted), Some(Look { error, losses, .. })) = (self.stop.error, &self.seen) else { return Ok(()) };
        let refused = |allowed: String| Err(Error::setting("error", format!("{}%", 100.0 * wanted), allowed));
        if error.unknown.off_surfaces.is_all() {
            return refused("cannot be reached, because no point lies on a surface, and some light of this scene is only found there; move the points onto surfaces".to_owned());
        }
        if losses.relative > wanted {
            let percent = 100.0 * losses.relative;
            return refused(match losses.cut_off > losses.clamped {
                true => format!(
                    "cannot be reached, because photons are cut off after {bounces} bounces, and what they carry may add up to {percent:.2} % of the result; allow more `bounces`"
                ),
                false => format!(
                    "cannot be reached, because limits of shading normals, of paths between mirrors and of large values keep light from the result that may add up to {percent:.2} % of it; ask for a larger error, or run without `error` to see how much each keeps"
                ),
            });
        }
        if let Some(Bias { lower, upper, .. }) = error.bias
            && self.alpha == 1.0
            && lower > wanted
        {
            return refused(format!(
                "cannot be reached: the bias of the radius alone is {:.2} % to {:.2} %, and the radius never shrinks; use a smaller `radius`",
                100.0 * lower,
                100.0 * upper
            ));
        }
        Ok(())
    }

    /// The bias after so many rounds and its bound: of the first round's radius as extra runs gave it, which is a bound, or as the film did
    /// at a look.
    fn bias(&self, look: &Look, rounds: f64) -> [f64; 2] {
        let square = |rounds: f64| mean_squared_radius(self.alpha, rounds as u32);
        let at = f64::from(look.error.rounds);
        match (self.stop.bias, look.error.bias) {
            (Some(bias), _) => [bias * square(rounds); 2],
            (None, Some(Bias { relative, upper, .. })) if rounds == at => [relative, upper],
            (None, Some(bias)) => bias.expected(square(rounds) / square(at), (at / rounds).powf(self.alpha)),
            (None, None) => [0.0; 2],
        }
    }

    pub(crate) fn has_photons(&self, photons: u64) -> bool {
        self.stop.photons.is_some_and(|wanted| photons >= wanted)
    }

    /// Whether the run has done enough after so many blocks and photons.
    pub(crate) fn end(&self, blocks: u32, photons: u64) -> Option<End> {
        let rounds = blocks * self.rounds_per_block;
        let small_enough = |wanted: f64| self.error().is_some_and(|(at, error)| at == rounds && error <= wanted);
        if self.stop.error.is_some_and(small_enough) {
            return Some(End::Error);
        }
        self.has_photons(photons).then_some(End::Photons)
    }

    /// Whether the run's time is up.
    pub(crate) fn is_late(&self) -> bool {
        self.deadline().is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// How far the run has come, in rounds, which have so many photons each.
    pub(crate) fn progress(&self, rounds: f64, most_rounds: u32, photons_per_round: u64, ledger: Ledger) -> Progress {
        let seconds = self.started.elapsed().as_secs_f64();
        let a_round = seconds / rounds.max(1e-9);
        let most = f64::from(most_rounds);
        let by_photons = self.stop.photons.map_or(most, |photons| (photons as f64 / photons_per_round.max(1) as f64).ceil());
        // Before the first look nobody knows when the error will be what is wanted.
        let by_error = match self.stop.error {
            Some(wanted) => self.seen.as_ref().map(|seen| self.rounds_wanted(wanted, seen, most)),
            None => Some(most),
        };
        let by_rounds = by_error.filter(|_| rounds > 0.0).map(|by_error| a_round * (by_error.min(by_photons).min(most) - rounds).max(0.0));
        let by_time = self.stop.seconds.map(|limit| (limit - seconds).max(0.0));
        Progress {
            done: rounds as u64,
            total: u64::from(most_rounds),
            seconds,
            seconds_left: by_rounds.into_iter().chain(by_time).reduce(f64::min),
            error: self.error().map(|(_, error)| error).filter(|error| error.is_finite()),
            error_wanted: self.stop.error,
            photons: ledger.emitted,
            ledger,
        }
    }

    /// Rounds after which the error will be what is wanted: the square of the noise falls as 1 / rounds, and that of light from maps as
    /// rounds^-alpha (Knaus and Zwicker 2011); the bias as the radii's mean square, what nothing has reached as 1 / (rounds and area of
    /// the discs), and what is unseen as 1 / rounds.
    fn rounds_wanted(&self, wanted: f64, look: &Look, most: f64) -> f64 {
        let Look { error: FilmError { rounds, noise, unknown, unseen, places, .. }, most_noise, losses } = look;
        let (at, of_maps) = (f64::from(*rounds), places.map_or(1.0, |places| places.of_maps()));
        let error = |rounds: f64| {
            let unknown = unknown.relative * (at / rounds).powf(self.alpha);
            let quieter = (1.0 - of_maps) * at / rounds + of_maps * (at / rounds).powf(self.alpha);
            let noise = [noise, most_noise].map(|noise| noise * quieter.sqrt());
            let bias = self.bias(look, rounds).map(|bias| bias + losses.relative);
            bound_of_both(noise, bias).hypot(unknown).hypot(unseen * at / rounds)
        };
        let (mut less, mut more) = (at.min(most), most);
        if error(less) <= wanted {
            return less;
        }
        // Halves the range of the logarithm: 50 times are far below a round.
        for _ in 0..50 {
            let middle = (less * more).sqrt();
            if error(middle) <= wanted { more = middle } else { less = middle }
        }
        more
    }
}
