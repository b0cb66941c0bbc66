//! The Vulkan compute engine: one device, one queue, buffers, kernels, commands and timestamps. It
//! knows nothing of photons.

pub(crate) mod buffer;
pub(crate) mod check;
pub(crate) mod clock;
pub(crate) mod commands;
mod descriptor_sets;
pub mod device;
mod faults;
pub(crate) mod kernel;
mod labels;
mod mapped_file;
mod pace;
mod platform;
mod reconvergence;
mod specialize;
pub(crate) mod timestamps;
mod validation;
#[cfg(feature = "window")]
pub(crate) mod window;
#[cfg(not(feature = "window"))]
#[path = "no_window.rs"]
mod window;

use std::cell::{Cell, RefCell};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

pub(crate) use buffer::{AnyBuffer, Buffer, HeldMemory, Memory};
pub(crate) use commands::dispatch_by_sums;
pub(crate) use commands::{Commands, Extent, Interrupt};
pub use device::DeviceFacts;
pub(crate) use device::Reconvergence;
pub(crate) use kernel::{Constants, Kernel, Module};
pub(crate) use mapped_file::MappedFile;

use crate::error::{Error, Result};
use clock::Idleness;
use device::Loaded;
use labels::Labels;
use validation::Messages;
use window::{Surface, Window};

/// The kernels that `build.rs` found, one struct each.
#[allow(dead_code, reason = "tests alone use some")]
pub(crate) mod kernels {
    use super::buffer::{AnyBuffer, Buffer};
    use super::kernel::{Binding, Kernel, Module, ReflectedStruct};
    use crate::records::Field;

    include!(concat!(env!("OUT_DIR"), "/kernels.rs"));
}

/// How to open a device.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Index or part of a name; `None` prefers a discrete GPU.
    pub device: Option<String>,
    /// Validation layer with synchronisation validation.
    pub validate: bool,
    /// Time every dispatch beside every pass; each costs two more timestamps.
    pub time_dispatches: bool,
    /// Keep a card busy before the first round of every run, so that its times are taken at full clock.
    pub warm_up: bool,
    /// Bytes that all buffers of the device may take together; `None` for half of its memory.
    pub memory: Option<u64>,
    /// Split work by the plan alone and not by the time that it takes, so that dispatches and submissions can be counted.
    pub by_plan: bool,
    /// Behave as on a device without timestamps.
    pub without_timestamps: bool,
    /// Behave as on a device without 64-bit atomics.
    pub without_int64_atomics: bool,
    /// SPIR-V in place of a kernel's own, by the kernel's name: how tests plant faults.
    pub replaced: Vec<(String, Vec<u32>)>,
}

/// What a device has been asked to do so far, by counts, which no clock disturbs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Work {
    pub pipelines: usize,
    pub dispatches: u64,
    /// Of dispatches whose size the host knows.
    pub invocations: u64,
}

/// An open device, of one thread at a time.
pub struct Gpu {
    facts: DeviceFacts,
    options: Options,
    idleness: Cell<Idleness>,
    work: Cell<Work>,
    queue: vk::Queue,
    pipelines: RefCell<kernel::Pipelines>,
    set_layouts: kernel::SetLayouts,
    cache: kernel::DiskCache,
    context: Arc<Context>,
}

/// What must outlive every object of the device; destroyed with the last of them.
pub(crate) struct Context {
    allocator: Mutex<Option<Allocator>>,
    held: Mutex<HeldMemory>,
    device: ash::Device,
    labels: Option<Labels>,
    /// Of the window, if there is one.
    surface: Option<Surface>,
    physical_device: vk::PhysicalDevice,
    loaded: Loaded,
}

impl Context {
    /// `None` once the device goes.
    fn allocator(&self) -> MutexGuard<'_, Option<Allocator>> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn held(&self) -> MutexGuard<'_, HeldMemory> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        self.allocator().take();
        // SAFETY: every object of the device holds an Arc of this context, so all are gone, and the allocator has freed its memory.
        unsafe { self.device.destroy_device(None) };
    }
}

/// Calls Vulkan, and turns what fails into an [`Error`] that names the call.
pub(crate) fn call<T>(name: &'static str, vulkan: impl FnOnce() -> ash::prelude::VkResult<T>) -> Result<T> {
    faults::planted(name).and_then(|()| vulkan()).map_err(|code| match code {
        vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { call: name },
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Error::OutOfMemory { call: name, what: "the device's memory is full".into() },
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::OutOfMemory { call: name, what: "the host's memory is full".into() },
        code => Error::Device { call: name, reason: format!("{code} ({code:?})") },
    })
}

/// Less than this is of no use to any run, bytes.
pub const LEAST_MEMORY: u64 = 1 << 20;

impl Gpu {
    /// Opens a device and runs the start-up check on it.
    pub fn open(options: &Options) -> Result<Gpu> {
        Gpu::open_in(options, None)
    }

    /// The same for pictures in a window.
    pub(crate) fn open_in(options: &Options, window: Option<&Arc<Window>>) -> Result<Gpu> {
        faults::check()?;
        let loaded = device::instance(options.validate, window).map_err(|error| match (error, &options.device) {
            (Error::NoVulkan { reason }, Some(wanted)) => {
                Error::DeviceAbsent { wanted: wanted.clone(), present: format!("none ({reason})") }
            }
            (error, _) => error,
        })?;
        let surface = window.map(|window| Surface::new(&loaded.entry, &loaded.instance, window)).transpose()?;
        let (physical_device, mut facts) = device::choose(&loaded.instance, options.device.as_deref())?;
        if let Some(surface) = &surface {
            facts.queue_family = surface.queue_family(&loaded.instance, physical_device, &facts)?;
        }
        let (device, queue) = device::create(&loaded.instance, physical_device, &facts, surface.is_some())?;
        facts.timestamp_bits = if options.without_timestamps { 0 } else { facts.timestamp_bits };
        facts.int64_atomics &= !options.without_int64_atomics;
        if let Some(memory) = options.memory {
            facts.usable_memory_bytes = memory;
        }
        let labels = loaded.has_labels.then(|| Labels::new(&loaded.instance, &device));
        let held = Mutex::default();
        let context = Arc::new(Context { allocator: Mutex::default(), held, device, labels, surface, physical_device, loaded });
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: context.loaded.instance.clone(),
            device: context.device.clone(),
            physical_device,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: options.memory.map_or_else(Default::default, buffer::blocks_within),
        });
        *context.allocator() = Some(allocator.map_err(|error| Error::Device { call: "the memory allocator", reason: error.to_string() })?);
        let cache = kernel::DiskCache::open(&context, &facts)?;
        let mut gpu = Gpu {
            facts,
            options: options.clone(),
            idleness: Cell::new(Idleness::new(Instant::now())),
            work: Cell::default(),
            queue,
            pipelines: RefCell::default(),
            set_layouts: kernel::SetLayouts::new(&context),
            cache,
            context,
        };
        gpu.facts.votes_in_loops = check::run(&gpu)?;
        if gpu.options.warm_up {
            clock::prepare(&gpu)?;
        }
        Ok(gpu)
    }

    /// Devices that the loader lists, in its order.
    pub fn list() -> Result<Vec<DeviceFacts>> {
        let loaded = device::instance(false, None)?;
        Ok(device::all(&loaded.instance)?.into_iter().map(|(_, facts)| facts).collect())
    }

    /// From now on runs this SPIR-V in place of the kernels' own, by the kernel's name. Kernels that were replaced before and are
    /// not named now get their own back. The start-up check is not repeated.
    pub fn replace(&mut self, replaced: Vec<(String, Vec<u32>)>) {
        let before = std::mem::replace(&mut self.options.replaced, replaced);
        let changed = |kernel: &str| before.iter().chain(&self.options.replaced).any(|(name, _)| name == kernel);
        self.pipelines.get_mut().forget(changed);
    }

    pub fn facts(&self) -> &DeviceFacts {
        &self.facts
    }

    pub(crate) fn work(&self) -> Work {
        self.work.get()
    }

    fn add_work(&self, more: Work) {
        let Work { pipelines, dispatches, invocations } = self.work.get();
        self.work.set(Work {
            pipelines: pipelines + more.pipelines,
            dispatches: dispatches + more.dispatches,
            invocations: invocations + more.invocations,
        });
    }

    /// Opens the device anew, as is needed where it was lost. Nothing that was made with it is of use then.
    pub fn reopen(&mut self) -> Result<()> {
        let index = self.facts.index.to_string();
        let usable_memory_bytes = self.facts.usable_memory_bytes;
        let window = self.context.surface.as_ref().map(Surface::window);
        let fresh = Gpu::open_in(&Options { device: Some(index), ..self.options.clone() }, window)?;
        *self = Gpu { options: self.options.clone(), ..fresh };
        self.facts.usable_memory_bytes = usable_memory_bytes;
        Ok(())
    }

    /// Plans made from now on use half of the memory; `false` where that would be next to none.
    pub fn use_less_memory(&mut self) -> bool {
        let half = self.facts.usable_memory_bytes / 2;
        let is_enough = half >= LEAST_MEMORY;
        if is_enough {
            self.facts.usable_memory_bytes = half;
        }
        is_enough
    }

    /// Fails if the validation layer has said anything so far.
    pub fn check_validation(&self) -> Result<()> {
        let messages = self.context.loaded.messages.as_ref().map(Messages::all).unwrap_or_default();
        match messages.first() {
            None => Ok(()),
            Some(first) => Err(Error::Validation { count: messages.len(), first: first.clone() }),
        }
    }
}
