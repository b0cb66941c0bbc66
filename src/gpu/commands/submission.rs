//! Commands that run: the wait for them, what they took, and who ends a run between two submissions.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ash::vk;

use super::Commands;
use super::barriers::Hazards;
use crate::error::{Error, Result};
use crate::gpu::call;
use crate::timings::{Clock, Span};

/// When a run that is interrupted ends: looked at after every submission.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interrupt<'a> {
    pub cancelled: &'a AtomicBool,
    pub deadline: Option<Instant>,
}

impl Interrupt<'_> {
    pub(crate) fn is_up(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

impl<'gpu> Commands<'gpu> {
    /// From now on every submission fails with [`Error::Interrupted`] once it has ended, if the interrupt is up by then.
    pub(crate) fn set_interrupt(&mut self, interrupt: Option<Interrupt<'gpu>>) {
        self.interrupt = interrupt;
    }

    /// Runs everything recorded so far and waits for it. Scopes that are open go on in the next
    /// submission; the time between the two is in none.
    pub(crate) fn submit(&mut self) -> Result<()> {
        let open: Vec<String> = self.open_scopes.iter().map(|scope| scope.name.clone()).collect();
        while !self.open_scopes.is_empty() {
            self.close_scope();
        }
        let host_reads = vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ);
        self.record_barrier(host_reads);

        let context = self.gpu.context.clone();
        let device = &context.device;
        let submitted = Instant::now();
        let command_buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.command_buffer)];
        let submission = [vk::SubmitInfo2::default().command_buffer_infos(&command_buffers)];
        // A driver may end even an endless wait, where it adds it to a clock that somebody sets (lavapipe does).
        let wait = || loop {
            // SAFETY: the fence is alive.
            match unsafe { device.wait_for_fences(&[self.fence], true, u64::MAX) } {
                Err(vk::Result::TIMEOUT) => {}
                ended => break ended,
            }
        };
        // SAFETY: everything recorded is alive; the fence is unsignalled, and waiting for it ends
        // all use of it and of the command buffer.
        let run = || unsafe {
            call("vkEndCommandBuffer", || device.end_command_buffer(self.command_buffer))?;
            call("vkQueueSubmit2", || device.queue_submit2(self.gpu.queue, &submission, self.fence))?;
            call("vkWaitForFences", wait)?;
            call("vkResetFences", || device.reset_fences(&[self.fence]))
        };
        run().inspect_err(|_| {
            // Nothing may be destroyed that is still in use, also on a device that fails; a lost one answers at once.
            // SAFETY: the queue is of this thread alone.
            let _ = unsafe { device.device_wait_idle() };
        })?;
        let wall = submitted.elapsed();
        self.gpu.idleness.set(self.gpu.idleness.get().after(submitted, submitted + wall));
        self.submission_count += 1;
        self.collect_timings(submitted, wall)?;

        self.descriptor_sets.clear()?;
        self.bound_scene = None;
        self.staging.clear();
        self.hazards = Hazards::default();
        self.work = 0;
        self.begin()?;
        open.into_iter().for_each(|name| self.open_scope(name));
        if self.interrupt.is_some_and(|interrupt| interrupt.is_up()) { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Books the submission: each scope with its device time, and the host's time of the whole under
    /// the outermost scope's name.
    fn collect_timings(&mut self, submitted: Instant, wall: Duration) -> Result<()> {
        let start = submitted.duration_since(self.started);
        let timed = std::mem::take(&mut self.timed_scopes);
        let mut took: HashMap<&str, Duration> = HashMap::new();
        if let Some(times) = self.timestamps.read(&timed)? {
            for (scope, (begin, duration)) in timed.iter().zip(times) {
                let span = Span::of_host(&scope.name, start + begin, duration);
                self.timings.add(Span { clock: Clock::Gpu, handled: scope.handled, ..span });
                *took.entry(&scope.name).or_default() += duration;
            }
        } else {
            // Without timestamps each scope may have taken all of the time.
            took.extend(timed.iter().map(|scope| (scope.name.as_str(), wall)));
        }
        self.pace.learn(&took);
        let outermost = timed.last().map(|scope| scope.name.split('/').next().unwrap_or_default().to_owned());
        if let Some(name) = outermost {
            self.timings.add(Span::of_host(&name, start, wall));
        }
        Ok(())
    }
}
