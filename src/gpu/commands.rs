//! A recording of dispatches and copies: names every buffer, places barriers by what each kernel
//! reads and writes, times every scope, and stays within the device's limits.

mod barriers;
mod dispatch;
mod submission;
mod transfer;

use std::time::{Duration, Instant};

use ash::vk;
pub(crate) use dispatch::Extent;
pub(crate) use dispatch::dispatch_by_sums;
pub(crate) use submission::Interrupt;

use super::clock::{self, LEAST_WARM_UP};
use super::descriptor_sets::DescriptorSets;
use super::pace::Pace;
use super::timestamps::{TimedScope, Timestamps};
use super::{AnyBuffer, Constants, DeviceFacts, Gpu, Module, call};
use crate::error::Result;
use crate::timings::{Handled, Span, Timings};
use barriers::Hazards;

struct OpenScope {
    name: String,
    begin: u32,
    handled: Handled,
}

/// Commands being recorded, and the timings of those that ran.
pub(crate) struct Commands<'gpu> {
    gpu: &'gpu Gpu,
    constants: Constants,
    started: Instant,
    pool: vk::CommandPool,
    command_buffer: vk::CommandBuffer,
    fence: vk::Fence,
    descriptor_sets: DescriptorSets,
    /// What stands in set 0, if that is a scene: it is bound once and stays for as long as kernels look at it.
    bound_scene: Option<vk::DescriptorSet>,
    timestamps: Timestamps,
    open_scopes: Vec<OpenScope>,
    timed_scopes: Vec<TimedScope>,
    hazards: Hazards,
    /// Buffers that only this submission needs.
    staging: Vec<AnyBuffer>,
    work: u64,
    pace: Pace,
    interrupt: Option<Interrupt<'gpu>>,
    dispatch_count: u64,
    submission_count: u64,
    timings: Timings,
    /// Of the device, before these commands.
    pipelines_before: usize,
}

/// A command buffer and its pool, and a fence that waits for it, which are destroyed by whoever asks for them.
pub(super) fn command_buffer(gpu: &Gpu) -> Result<(vk::CommandPool, vk::CommandBuffer, vk::Fence)> {
    let device = &gpu.context.device;
    let info = vk::CommandPoolCreateInfo::default()
        .queue_family_index(gpu.facts.queue_family)
        .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
    // SAFETY: all infos are complete.
    unsafe {
        let pool = call("vkCreateCommandPool", || device.create_command_pool(&info, None))?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let command_buffer = call("vkAllocateCommandBuffers", || device.allocate_command_buffers(&info))?[0];
        let fence = call("vkCreateFence", || device.create_fence(&vk::FenceCreateInfo::default(), None))?;
        Ok((pool, command_buffer, fence))
    }
}

impl<'gpu> Commands<'gpu> {
    /// `started` is the zero of all times.
    pub(crate) fn new(gpu: &'gpu Gpu, constants: Constants, started: Instant) -> Result<Commands<'gpu>> {
        let timestamps = Timestamps::new(gpu)?;
        let (pool, command_buffer, fence) = command_buffer(gpu)?;
        let mut commands = Commands {
            gpu,
            constants,
            started,
            pool,
            command_buffer,
            fence,
            descriptor_sets: DescriptorSets::new(gpu.context.clone()),
            bound_scene: None,
            timestamps,
            open_scopes: Vec::new(),
            timed_scopes: Vec::new(),
            hazards: Hazards::default(),
            staging: Vec::new(),
            work: 0,
            pace: Pace::new(gpu.options.by_plan),
            interrupt: None,
            dispatch_count: 0,
            submission_count: 0,
            timings: Timings::default(),
            pipelines_before: gpu.work().pipelines,
        };
        commands.begin()?;
        Ok(commands)
    }

    fn begin(&mut self) -> Result<()> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last submission has ended, so the command buffer may be recorded again.
        call("vkBeginCommandBuffer", || unsafe { self.gpu.context.device.begin_command_buffer(self.command_buffer, &info) })?;
        self.timestamps.forget();
        // The fence of the last submission made its writes available; this makes them visible here.
        self.barrier();
        Ok(())
    }

    /// Records `body` under a name inside the scopes that are open, and times it on the device.
    pub(crate) fn scope<T>(&mut self, name: &str, body: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let path = match self.open_scopes.last() {
            Some(outer) => format!("{}/{name}", outer.name),
            None => name.to_owned(),
        };
        self.timings.count(&path);
        let outer = self.open_scopes.len();
        self.open_scope(path);
        let result = body(self);
        // None is open any more where a submission failed.
        if self.open_scopes.len() > outer {
            self.close_scope();
        }
        result
    }

    fn open_scope(&mut self, name: String) {
        self.gpu.context.begin_label(self.command_buffer, name.rsplit('/').next().unwrap_or_default());
        let begin = self.timestamps.write(self.command_buffer);
        self.open_scopes.push(OpenScope { name, begin, handled: Handled::default() });
    }

    fn close_scope(&mut self) {
        let OpenScope { name, begin, handled } = self.open_scopes.pop().expect("a scope is open");
        let end = self.timestamps.write(self.command_buffer);
        self.gpu.context.end_label(self.command_buffer);
        self.timed_scopes.push(TimedScope { name, begin, end, handled });
    }

    /// Timestamps left in this submission; a scope takes two.
    pub(crate) fn timestamps_left(&self) -> u32 {
        self.timestamps.left()
    }

    /// Notes what is handled by what was just recorded: photons and bytes by all scopes that are open, stored photons by the innermost.
    pub(crate) fn count(&mut self, handled: Handled) {
        for scope in &mut self.open_scopes {
            scope.handled.photons += handled.photons;
            scope.handled.bytes += handled.bytes;
        }
        if let Some(innermost) = self.open_scopes.last_mut() {
            innermost.handled.stored += handled.stored;
        }
    }

    fn innermost_scope(&self) -> &str {
        self.open_scopes.last().map_or("", |scope| &scope.name)
    }

    /// Counts work of any unit that was recorded in the innermost scope.
    pub(crate) fn add_work(&mut self, amount: u64) {
        self.work += amount;
        let scope = self.innermost_scope().to_owned();
        self.pace.add_work(scope, amount);
    }

    /// Work that a dispatch of the innermost scope should do at most, where a plan allows so much between two submissions. It decides
    /// how work is split, which changes no result.
    pub(crate) fn paced(&self, work_per_submission: u64) -> u64 {
        self.pace.fits(self.innermost_scope(), work_per_submission)
    }

    /// Whether what is recorded should run before more is recorded in the innermost scope.
    pub(crate) fn is_due(&self, work_per_submission: u64) -> bool {
        self.pace.is_due(self.innermost_scope(), work_per_submission) || self.is_full(work_per_submission)
    }

    /// Whether what is recorded amounts to a submission.
    pub(crate) fn is_full(&self, work_per_submission: u64) -> bool {
        self.work >= work_per_submission || self.pace.is_long()
    }

    pub(crate) fn timings(&mut self) -> &mut Timings {
        &mut self.timings
    }

    /// Ends the recording; `whole` names the row that spans all of it on the host's clock.
    pub(crate) fn finish(mut self, whole: &str) -> Timings {
        let mut timings = std::mem::take(&mut self.timings);
        timings.add(Span::of_host(whole, Duration::ZERO, self.started.elapsed()));
        timings
    }

    /// Where the device was opened for it, keeps a card busy for as long as it idled: while the host makes buffers, its clock
    /// falls, but not its memory's, which favours passes that wait for memory. The zero of all times moves by as much, so that
    /// it counts in none.
    pub(crate) fn warm_up(&mut self) -> Result<()> {
        if self.gpu.options.warm_up {
            let began = Instant::now();
            clock::warm_up(self.gpu, self.gpu.idleness.get().at(began).max(LEAST_WARM_UP))?;
            self.started += began.elapsed();
        }
        Ok(())
    }

    /// Makes the pipelines of these kernels.
    pub(crate) fn prepare(&self, modules: &[Module]) -> Result<()> {
        self.gpu.prepare(modules, &self.constants)
    }

    /// Pipelines made so far.
    pub(crate) fn pipelines(&self) -> usize {
        self.gpu.work().pipelines - self.pipelines_before
    }

    pub(crate) fn gpu(&self) -> &'gpu Gpu {
        self.gpu
    }

    pub(crate) fn facts(&self) -> &DeviceFacts {
        &self.gpu.facts
    }

    /// Dispatches recorded so far.
    pub(crate) fn dispatch_count(&self) -> u64 {
        self.dispatch_count
    }

    pub(crate) fn submission_count(&self) -> u64 {
        self.submission_count
    }
}

impl Drop for Commands<'_> {
    fn drop(&mut self) {
        let device = &self.gpu.context.device;
        // SAFETY: every submission was waited for.
        unsafe {
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
