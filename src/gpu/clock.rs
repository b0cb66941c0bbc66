//! Warm-up: the clock of an idle GPU falls to as little as a fifth, and rises again with work.

use std::time::{Duration, Instant};

use super::kernels::MeasureFloat;
use super::{Commands, Constants, Extent, Gpu, Kernel, Memory};
use crate::error::Result;
use crate::records::MeasurePush;

/// Work after which a card runs at its clock.
pub(crate) const WARM_UP: Duration = Duration::from_millis(300);
/// What is done of it in any case.
pub(crate) const LEAST_WARM_UP: Duration = Duration::from_millis(30);

/// How long a card has idled and not worked since, at most [`WARM_UP`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Idleness {
    owed: Duration,
    since: Instant,
}

impl Idleness {
    /// Of a card that nobody used before.
    pub(super) fn new(now: Instant) -> Idleness {
        Idleness { owed: WARM_UP, since: now }
    }

    /// It idled until `began`, and worked until `ended`.
    #[must_use]
    pub(super) fn after(self, began: Instant, ended: Instant) -> Idleness {
        Idleness { owed: self.at(began).saturating_sub(ended - began), since: ended }
    }

    pub(super) fn at(self, now: Instant) -> Duration {
        (self.owed + now.saturating_duration_since(self.since)).min(WARM_UP)
    }
}

const ITEMS: u32 = 1 << 20;
const STEPS: u32 = 1024;
const GROUP_SIZE: u32 = 256;

/// Makes the pipeline of [`warm_up`], so that no run does.
pub(super) fn prepare(gpu: &Gpu) -> Result<()> {
    gpu.prepare(&[MeasureFloat::MODULE], &Constants::new(GROUP_SIZE))
}

/// Keeps a card busy for a while, so that what follows at once runs at full clock. Does nothing on a software device,
/// which has no clock of its own.
pub(crate) fn warm_up(gpu: &Gpu, time: Duration) -> Result<()> {
    if gpu.facts().kind == "cpu" {
        return Ok(());
    }
    gpu.without_peaks(|| {
        prepare(gpu)?;
        let mut commands = Commands::new(gpu, Constants::new(GROUP_SIZE), Instant::now())?;
        let results = gpu.buffer::<f32>("results", u64::from(ITEMS), Memory::Device)?;
        let push = MeasurePush { item_count: ITEMS, step_count: STEPS, mask: 0 };
        let began = Instant::now();
        while began.elapsed() < time {
            commands.dispatch(MeasureFloat { results: &results }, &push, Extent::Items(u64::from(ITEMS)))?;
            commands.submit()?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_pays_for_idle_time() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let ms = Duration::from_millis;
        let idleness = Idleness::new(start);
        assert_eq!(idleness.at(at(1000)), WARM_UP);
        let idleness = idleness.after(at(1000), at(1100));
        assert_eq!(idleness.at(at(1100)), WARM_UP - ms(100));
        let idleness = idleness.after(at(1150), at(2000));
        assert_eq!(idleness.at(at(2000)), Duration::ZERO);
        assert_eq!(idleness.at(at(2007)), ms(7));
        // Other commands of the same device may have ended later than these began.
        assert_eq!(idleness.after(at(1990), at(2001)).at(at(2001)), Duration::ZERO);
    }
}
