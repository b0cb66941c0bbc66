//! Timestamp queries of one submission, as nested scopes.

use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use super::{Context, Gpu, call};
use crate::error::Result;
use crate::timings::Handled;

/// Queries of one submission; a scope takes two.
pub(super) const QUERY_COUNT: u32 = 4096;
/// Queries that are reset together, as writing comes to them: few runs need them all, and the validation layer keeps some bytes of
/// each reset for ever.
const RESET_STEP: u32 = 64;

/// A scope that began and ended in this submission.
pub(super) struct TimedScope {
    pub(super) name: String,
    pub(super) begin: u32,
    pub(super) end: u32,
    pub(super) handled: Handled,
}

pub(super) struct Timestamps {
    pool: vk::QueryPool,
    /// Bits of a tick count that the queue fills in; 0 where it has no timestamps.
    valid_bits: u32,
    period_ns: f64,
    used: u32,
    /// Queries from the first on that were reset in this submission.
    ready: u32,
    context: Arc<Context>,
}

impl Timestamps {
    pub(super) fn new(gpu: &Gpu) -> Result<Timestamps> {
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(QUERY_COUNT);
        let valid_bits = gpu.facts.timestamp_bits;
        let pool = if valid_bits == 0 {
            vk::QueryPool::null()
        } else {
            // SAFETY: `info` is complete; destroyed in Drop.
            call("vkCreateQueryPool", || unsafe { gpu.context.device.create_query_pool(&info, None) })?
        };
        Ok(Timestamps {
            pool,
            valid_bits,
            period_ns: f64::from(gpu.facts.timestamp_period_ns),
            used: 0,
            ready: 0,
            context: gpu.context.clone(),
        })
    }

    /// Queries left in this submission.
    pub(super) fn left(&self) -> u32 {
        QUERY_COUNT - self.used
    }

    /// Forgets the queries of the last submission.
    pub(super) fn forget(&mut self) {
        (self.used, self.ready) = (0, 0);
    }

    /// Records the time at which everything before has ended.
    pub(super) fn write(&mut self, command_buffer: vk::CommandBuffer) -> u32 {
        assert!(self.used < QUERY_COUNT, "a submission has {QUERY_COUNT} timestamps");
        let query = self.used;
        self.used += 1;
        if self.valid_bits != 0 {
            // SAFETY: the command buffer is recording, the last submission has ended, and the query is not used in this one before
            // it was reset.
            unsafe {
                if query == self.ready {
                    self.context.device.cmd_reset_query_pool(command_buffer, self.pool, query, RESET_STEP);
                    self.ready += RESET_STEP;
                }
                self.context.device.cmd_write_timestamp2(command_buffer, vk::PipelineStageFlags2::ALL_COMMANDS, self.pool, query);
            }
        }
        query
    }

    /// (start since the submission's first timestamp, duration) of each scope, once the submission
    /// has ended; `None` without timestamps.
    pub(super) fn read(&self, scopes: &[TimedScope]) -> Result<Option<Vec<(Duration, Duration)>>> {
        if self.valid_bits == 0 || self.used == 0 {
            return Ok(None);
        }
        let mut ticks = vec![0u64; self.used as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: `ticks` holds one 64-bit result a query.
        call("vkGetQueryPoolResults", || unsafe { self.context.device.get_query_pool_results(self.pool, 0, &mut ticks, flags) })?;
        let between = |from: u32, to: u32| elapsed(ticks[from as usize], ticks[to as usize], self.valid_bits, self.period_ns);
        Ok(Some(scopes.iter().map(|scope| (between(0, scope.begin), between(scope.begin, scope.end))).collect()))
    }
}

/// Time between two tick counts of `valid_bits` bits, which may have wrapped once.
fn elapsed(from: u64, to: u64, valid_bits: u32, period_ns: f64) -> Duration {
    let mask = if valid_bits >= 64 { u64::MAX } else { (1 << valid_bits) - 1 };
    let ticks = to.wrapping_sub(from) & mask;
    Duration::from_nanos((ticks as f64 * period_ns).round() as u64)
}

impl Drop for Timestamps {
    fn drop(&mut self) {
        // SAFETY: commands wait for the device before they return, so no query is under way.
        unsafe { self.context.device.destroy_query_pool(self.pool, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tick_counts_wrap_at_their_valid_bits() {
        assert_eq!(elapsed(100, 400, 64, 2.5), Duration::from_nanos(750));
        assert_eq!(elapsed((1 << 36) - 10, 20, 36, 1.0), Duration::from_nanos(30));
        assert_eq!(elapsed(u64::MAX - 4, 5, 64, 1.0), Duration::from_nanos(10));
    }
}
