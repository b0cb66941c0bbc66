//! The clock at which a card runs: it falls, by up to five times, while the card idles, and rises again with work.

use std::time::{Duration, Instant};

use super::kernels::MeasureFloat;
use super::{Commands, Constants, Extent, Gpu, Memory};
use crate::error::Result;
use crate::records::MeasurePush;

/// Work after which a card runs at its clock.
pub const WARM_UP: Duration = Duration::from_millis(300);
const ITEMS: u32 = 1 << 20;
const STEPS: u32 = 1024;
const GROUP_SIZE: u32 = 256;

/// Keeps a card busy for a while, so that what follows at once runs at the clock of work. Does nothing on a software device,
/// which has no clock of its own.
pub fn warm_up(gpu: &Gpu, time: Duration) -> Result<()> {
    if gpu.facts().kind == "cpu" {
        return Ok(());
    }
    gpu.without_peaks(|| {
        let mut commands = Commands::new(gpu, Constants::new(GROUP_SIZE), Instant::now())?;
        let results = gpu.buffer::<u32>("results", u64::from(ITEMS), Memory::Device)?;
        let push = MeasurePush { item_count: ITEMS, step_count: STEPS, mask: 0 };
        let began = Instant::now();
        while began.elapsed() < time {
            commands.dispatch(MeasureFloat { results: &results }, &push, Extent::Items(u64::from(ITEMS)))?;
            commands.submit()?;
        }
        Ok(())
    })
}
