//! A recording of dispatches and copies: names every buffer, places barriers by what each kernel
//! reads and writes, times every scope, and stays within the device's limits.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ash::vk;
use bytemuck::Pod;

use super::clock::{self, LEAST_WARM_UP};
use super::descriptor_sets::DescriptorSets;
use super::hazards::{Access, Hazards};
use super::pace::Pace;
use super::timestamps::{TimedScope, Timestamps};
use super::{AnyBuffer, Buffer, Constants, Context, DeviceFacts, Gpu, Kernel, Memory, Module, Work, call};
use crate::error::{Error, Result};
use crate::records::DispatchArgs;
use crate::timings::{Clock, Handled, Span, Timings};

/// How many invocations or groups a dispatch has.
#[derive(Clone, Copy)]
pub enum Extent<'a> {
    /// One invocation an item; folded into rows where the device allows too few groups along x.
    Items(u64),
    /// Groups along x and y.
    Groups(u32, u32),
    /// As a [`DispatchArgs`] record on the device says.
    Indirect(&'a Buffer<DispatchArgs>),
}

struct OpenScope {
    name: String,
    begin: u32,
    handled: Handled,
}

/// Commands being recorded, and the timings of those that ran.
pub struct Commands<'gpu> {
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
    context: Arc<Context>,
}

/// Elements on their way to the host.
#[must_use]
pub struct ReadBack<T>(Option<Buffer<T>>);

impl<T: Pod> ReadBack<T> {
    /// The elements, once the commands that copy them have run.
    pub fn take(self) -> Vec<T> {
        self.0.map_or_else(Vec::new, |buffer| bytemuck::pod_collect_to_vec(buffer.mapped()))
    }
}

/// When a run that is interrupted ends: looked at after every submission.
#[derive(Debug, Clone, Copy)]
pub struct Interrupt<'a> {
    pub cancelled: &'a AtomicBool,
    pub deadline: Option<Instant>,
}

impl Interrupt<'_> {
    pub fn is_up(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

impl<'gpu> Commands<'gpu> {
    /// `started` is the zero of all times.
    pub fn new(gpu: &'gpu Gpu, constants: Constants, started: Instant) -> Result<Commands<'gpu>> {
        let device = &gpu.context.device;
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(gpu.facts.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        let timestamps = Timestamps::new(gpu)?;
        // SAFETY: all infos are complete; everything is destroyed in Drop.
        let (pool, command_buffer, fence) = unsafe {
            let pool = call("vkCreateCommandPool", || device.create_command_pool(&pool_info, None))?;
            let buffer_info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let command_buffer = call("vkAllocateCommandBuffers", || device.allocate_command_buffers(&buffer_info))?[0];
            let fence = call("vkCreateFence", || device.create_fence(&vk::FenceCreateInfo::default(), None))?;
            (pool, command_buffer, fence)
        };
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
            context: gpu.context.clone(),
        };
        commands.begin()?;
        Ok(commands)
    }

    fn begin(&mut self) -> Result<()> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last submission has ended, so the command buffer may be recorded again.
        call("vkBeginCommandBuffer", || unsafe { self.context.device.begin_command_buffer(self.command_buffer, &info) })?;
        self.timestamps.forget();
        // The fence of the last submission made its writes available; this makes them visible here.
        self.barrier();
        Ok(())
    }

    /// Records `body` under a name inside the scopes that are open, and times it on the device.
    pub fn scope<T>(&mut self, name: &str, body: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
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
        self.context.begin_label(self.command_buffer, name.rsplit('/').next().unwrap_or_default());
        let begin = self.timestamps.write(self.command_buffer);
        self.open_scopes.push(OpenScope { name, begin, handled: Handled::default() });
    }

    fn close_scope(&mut self) {
        let OpenScope { name, begin, handled } = self.open_scopes.pop().expect("a scope is open");
        let end = self.timestamps.write(self.command_buffer);
        self.context.end_label(self.command_buffer);
        self.timed_scopes.push(TimedScope { name, begin, end, handled });
    }

    /// Timestamps left in this submission; a scope takes two.
    pub fn timestamps_left(&self) -> u32 {
        self.timestamps.left()
    }

    /// Runs a kernel on its buffers.
    pub fn dispatch<K: Kernel>(&mut self, kernel: K, push: &K::Push, extent: Extent) -> Result<()> {
        if self.gpu.options.time_dispatches {
            return self.scope(K::MODULE.name, |commands| commands.record_dispatch(kernel, push, extent));
        }
        self.context.begin_label(self.command_buffer, K::MODULE.name);
        let recorded = self.record_dispatch(kernel, push, extent);
        self.context.end_label(self.command_buffer);
        recorded
    }

    fn record_dispatch<K: Kernel>(&mut self, kernel: K, push: &K::Push, extent: Extent) -> Result<()> {
        let () = K::FITS;
        let module = K::MODULE;
        let buffers = kernel.buffers();
        let pipeline = self.gpu.pipeline(&module, &self.constants)?;
        let numbered = module.bindings.iter().map(|binding| binding.binding).zip(&buffers);
        let own = self.descriptor_sets.get(pipeline.set_layouts[1], numbered.collect())?;
        let scene = kernel.scene();
        let scene_set =
            if scene.is_empty() { None } else { Some(self.descriptor_sets.get(pipeline.set_layouts[0], (0..).zip(&scene).collect())?) };
        // A kernel without a scene has another layout of set 0, and so disturbs what is bound there.
        let sets: Vec<_> = scene_set.filter(|_| self.bound_scene != scene_set).into_iter().chain([own]).collect();
        self.bound_scene = scene_set;
        let mut accesses: Vec<Access> =
            module.bindings.iter().zip(&buffers).map(|(binding, buffer)| (*buffer, binding.reads, binding.writes)).collect();
        accesses.extend(scene.iter().map(|buffer| (*buffer, true, false)));
        if let Extent::Indirect(args) = &extent {
            accesses.push((args.any(), true, false));
        }
        self.order(&accesses);

        let (device, command_buffer) = (&self.context.device, self.command_buffer);
        // SAFETY: the command buffer is recording; pipeline, sets and buffers live until the
        // submission has ended; group counts are within the device's limits.
        unsafe {
            device.cmd_bind_pipeline(command_buffer, vk::PipelineBindPoint::COMPUTE, pipeline.raw);
            device.cmd_bind_descriptor_sets(
                command_buffer,
                vk::PipelineBindPoint::COMPUTE,
                pipeline.layout,
                2 - sets.len() as u32,
                &sets,
                &[],
            );
            if module.push_bytes != 0 {
                device.cmd_push_constants(command_buffer, pipeline.layout, vk::ShaderStageFlags::COMPUTE, 0, bytemuck::bytes_of(push));
            }
            let groups = match extent {
                Extent::Items(items) => {
                    let DispatchArgs { x, y, z } = self.fold(items.div_ceil(u64::from(self.constants.group_size)));
                    device.cmd_dispatch(command_buffer, x, y, z);
                    u64::from(x) * u64::from(y)
                }
                Extent::Groups(x, y) => {
                    assert!(x <= self.gpu.facts.work_group_count_x && y <= self.gpu.facts.work_group_count_y, "{x} x {y} groups");
                    device.cmd_dispatch(command_buffer, x, y, 1);
                    u64::from(x) * u64::from(y)
                }
                Extent::Indirect(args) => {
                    device.cmd_dispatch_indirect(command_buffer, args.any().raw(), 0);
                    0
                }
            };
            let invocations = groups * u64::from(self.constants.group_size);
            self.gpu.add_work(Work { dispatches: 1, invocations, ..Work::default() });
        }
        self.dispatch_count += 1;
        Ok(())
    }

    /// Groups laid out in rows that the device allows; glsl/dispatch/dispatch.glsl reads them back.
    fn fold(&self, groups: u64) -> DispatchArgs {
        let columns = groups.min(u64::from(self.gpu.facts.work_group_count_x));
        let rows = if columns == 0 { 0 } else { groups.div_ceil(columns) };
        assert!(rows <= u64::from(self.gpu.facts.work_group_count_y), "{groups} groups");
        DispatchArgs { x: columns as u32, y: rows as u32, z: 1 }
    }

    /// Sets every 32-bit word of `count` elements of a buffer, from element `first` on.
    pub fn fill<T>(&mut self, buffer: &Buffer<T>, first: u64, count: u64, word: u32) {
        self.order(&[(buffer.any(), false, true)]);
        assert!(first + count <= buffer.count(), "{}: elements {first} to {}", buffer.any().name(), first + count);
        let element = size_of::<T>() as u64;
        let (device, raw) = (&self.context.device, buffer.any().raw());
        // SAFETY: the buffer outlives the submission; the range is inside it.
        unsafe { device.cmd_fill_buffer(self.command_buffer, raw, element * first, element * count, word) };
        self.count_bytes(element * count);
    }

    /// Sets all of a buffer to zero.
    pub fn clear<T>(&mut self, buffer: &Buffer<T>) {
        self.fill(buffer, 0, buffer.count(), 0);
    }

    /// Copies host data to the start of a buffer.
    pub fn upload<T: Pod>(&mut self, buffer: &Buffer<T>, content: &[T]) -> Result<()> {
        if content.is_empty() {
            return Ok(());
        }
        let count = content.len() as u64;
        let mut staging = self.gpu.buffer::<T>("upload", count, Memory::Upload)?;
        staging.mapped_mut().copy_from_slice(bytemuck::cast_slice(content));
        self.copy(&staging, buffer, count);
        self.staging.push(staging.into_any());
        Ok(())
    }

    /// Copies the first `count` elements of a buffer into another.
    pub fn copy<T>(&mut self, from: &Buffer<T>, to: &Buffer<T>, count: u64) {
        for buffer in [from, to] {
            assert!(count <= buffer.count(), "{}: {count} elements of {}", buffer.any().name(), buffer.count());
        }
        let (from, to) = (from.any(), to.any());
        self.order(&[(from, true, false), (to, false, true)]);
        let bytes = count * size_of::<T>() as u64;
        let region = [vk::BufferCopy::default().size(bytes)];
        // SAFETY: both buffers outlive the submission and hold so many elements.
        unsafe { self.context.device.cmd_copy_buffer(self.command_buffer, from.raw(), to.raw(), &region) };
        self.count_bytes(2 * bytes);
    }

    /// Runs everything recorded so far and returns the first `count` elements of a buffer.
    pub fn read<T: Pod>(&mut self, buffer: &Buffer<T>, count: usize) -> Result<Vec<T>> {
        let read_back = self.copy_out(buffer, count)?;
        self.submit()?;
        Ok(read_back.take())
    }

    /// Records a copy of the first `count` elements of a buffer to the host; after the next submission they can be taken.
    pub fn copy_out<T: Pod>(&mut self, buffer: &Buffer<T>, count: usize) -> Result<ReadBack<T>> {
        if count == 0 {
            return Ok(ReadBack(None));
        }
        let read_back = self.gpu.buffer::<T>("read back", count as u64, Memory::ReadBack)?;
        self.copy(buffer, &read_back, count as u64);
        Ok(ReadBack(Some(read_back)))
    }

    /// Notes what is handled by what was just recorded: photons and bytes by all scopes that are open, stored photons by the innermost.
    pub fn count(&mut self, handled: Handled) {
        for scope in &mut self.open_scopes {
            scope.handled.photons += handled.photons;
            scope.handled.bytes += handled.bytes;
        }
        if let Some(innermost) = self.open_scopes.last_mut() {
            innermost.handled.stored += handled.stored;
        }
    }

    fn count_bytes(&mut self, bytes: u64) {
        self.count(Handled { bytes, ..Handled::default() });
    }

    fn innermost_scope(&self) -> &str {
        self.open_scopes.last().map_or("", |scope| &scope.name)
    }

    /// Counts work of any unit that was recorded in the innermost scope.
    pub fn add_work(&mut self, amount: u64) {
        self.work += amount;
        let scope = self.innermost_scope().to_owned();
        self.pace.add_work(scope, amount);
    }

    /// Work that a dispatch of the innermost scope should do at most, where a plan allows so much between two submissions. It decides
    /// how work is split, which changes no result.
    pub fn paced(&self, work_per_submission: u64) -> u64 {
        self.pace.fits(self.innermost_scope(), work_per_submission)
    }

    /// Whether what is recorded should run before more is recorded in the innermost scope.
    pub fn is_due(&self, work_per_submission: u64) -> bool {
        self.pace.is_due(self.innermost_scope(), work_per_submission) || self.is_full(work_per_submission)
    }

    /// Whether what is recorded amounts to a submission.
    pub fn is_full(&self, work_per_submission: u64) -> bool {
        self.work >= work_per_submission || self.pace.is_long()
    }

    /// From now on every submission fails with [`Error::Interrupted`] once it has ended, if the interrupt is up by then.
    pub fn set_interrupt(&mut self, interrupt: Option<Interrupt<'gpu>>) {
        self.interrupt = interrupt;
    }

    /// Runs everything recorded so far and waits for it. Scopes that are open go on in the next
    /// submission; the time between the two is in none.
    pub fn submit(&mut self) -> Result<()> {
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

        let context = self.context.clone();
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

    pub fn timings(&mut self) -> &mut Timings {
        &mut self.timings
    }

    /// Ends the recording; `whole` names the row that spans all of it on the host's clock.
    pub fn finish(mut self, whole: &str) -> Timings {
        let mut timings = std::mem::take(&mut self.timings);
        timings.add(Span::of_host(whole, Duration::ZERO, self.started.elapsed()));
        timings
    }

    /// Where the device was opened for it, keeps a card busy for as long as it idled: while the host makes buffers, its clock
    /// falls, but not its memory's, which favours passes that wait for memory. The zero of all times moves by as much, so that
    /// it counts in none.
    pub fn warm_up(&mut self) -> Result<()> {
        if self.gpu.options.warm_up {
            let began = Instant::now();
            clock::warm_up(self.gpu, self.gpu.idleness.get().at(began).max(LEAST_WARM_UP))?;
            self.started += began.elapsed();
        }
        Ok(())
    }

    /// Makes the pipelines of these kernels.
    pub fn prepare(&self, modules: &[Module]) -> Result<()> {
        self.gpu.prepare(modules, &self.constants)
    }

    /// Pipelines made so far.
    pub fn pipelines(&self) -> usize {
        self.gpu.work().pipelines - self.pipelines_before
    }

    pub fn gpu(&self) -> &Gpu {
        self.gpu
    }

    pub fn facts(&self) -> &DeviceFacts {
        &self.gpu.facts
    }

    /// Dispatches recorded so far.
    pub fn dispatch_count(&self) -> u64 {
        self.dispatch_count
    }

    pub fn submission_count(&self) -> u64 {
        self.submission_count
    }
}

/// Barriers: one memory barrier before a command that conflicts with an earlier one.
impl Commands<'_> {
    /// Waits, if it must, before a command that touches this.
    fn order(&mut self, accesses: &[Access]) {
        if self.hazards.conflict(accesses) {
            self.barrier();
        }
        self.hazards.add(accesses);
    }

    fn barrier(&mut self) {
        let stages =
            vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER | vk::PipelineStageFlags2::DRAW_INDIRECT;
        self.record_barrier(
            vk::MemoryBarrier2::default()
                .src_stage_mask(stages)
                .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
                .dst_stage_mask(stages)
                .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE),
        );
        self.hazards = Hazards::default();
    }

    fn record_barrier(&self, barrier: vk::MemoryBarrier2) {
        let barriers = [barrier];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is recording.
        unsafe { self.context.device.cmd_pipeline_barrier2(self.command_buffer, &dependency) };
    }
}

impl Drop for Commands<'_> {
    fn drop(&mut self) {
        let device = &self.context.device;
        // SAFETY: every submission was waited for.
        unsafe {
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
