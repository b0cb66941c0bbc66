//! Storage buffers.

use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use gpu_allocator::{AllocationError, AllocationSizes};
use serde::Serialize;

use super::{Context, Gpu, call, faults};
use crate::error::{Error, Result};

/// Who touches a buffer's memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Memory {
    /// The device alone.
    Device,
    /// Written by the host, copied by the device.
    Upload,
    /// Copied by the device, read by the host.
    ReadBack,
}

/// Bytes of buffers: of those that are alive, and the most that were alive together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub(crate) struct HeldMemory {
    /// Of [`Memory::Device`].
    pub device_bytes: u64,
    pub peak_device_bytes: u64,
    /// Of the others, through which the host writes and reads.
    pub staging_bytes: u64,
    pub peak_staging_bytes: u64,
}

impl HeldMemory {
    fn take(&mut self, memory: Memory, bytes: u64) {
        let (now, peak) = match memory {
            Memory::Device => (&mut self.device_bytes, &mut self.peak_device_bytes),
            Memory::Upload | Memory::ReadBack => (&mut self.staging_bytes, &mut self.peak_staging_bytes),
        };
        *now += bytes;
        *peak = (*peak).max(*now);
    }

    fn give_back(&mut self, memory: Memory, bytes: u64) {
        match memory {
            Memory::Device => self.device_bytes -= bytes,
            Memory::Upload | Memory::ReadBack => self.staging_bytes -= bytes,
        }
    }
}

/// A buffer of elements of one type: one in another's place does not compile.
pub(crate) struct Buffer<T> {
    any: AnyBuffer,
    element: PhantomData<T>,
}

/// A buffer whose elements do not matter: as commands see it.
pub(crate) struct AnyBuffer {
    name: String,
    memory: Memory,
    size_bytes: u64,
    raw: vk::Buffer,
    allocation: Option<Allocation>,
    context: Arc<Context>,
}

/// What takes memory of a device.
const ALLOCATION: &str = "vkAllocateMemory";

fn full(name: &str, size_bytes: u64, why: String) -> Error {
    Error::OutOfMemory { call: ALLOCATION, what: format!("no {size_bytes} bytes for {name}: {why}") }
}

/// Blocks of memory that are taken at once where so many bytes may be: what is taken and not used stays small beside them.
pub(super) fn blocks_within(bytes: u64) -> AllocationSizes {
    let block = (bytes / 16).clamp(4 << 20, 256 << 20);
    AllocationSizes::new(block, block.min(64 << 20))
}

impl Gpu {
    /// A buffer of `count` elements of `T`, and of one at least, as Vulkan has no empty ones. Its
    /// content is undefined.
    pub(crate) fn buffer<T: Pod>(&self, name: &str, count: u64, memory: Memory) -> Result<Buffer<T>> {
        let size_bytes = count.max(1) * size_of::<T>() as u64;
        let largest = self.facts.storage_buffer_range_bytes.min(self.facts.allocation_bytes);
        assert!(size_bytes <= largest, "buffer {name}: {size_bytes} bytes, the plan must keep to {largest}");
        let info = vk::BufferCreateInfo::default().size(size_bytes).usage(
            vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::INDIRECT_BUFFER
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST,
        );
        if let Some(most) = self.options.memory.filter(|_| memory == Memory::Device) {
            let held = self.held_memory().device_bytes;
            if held + size_bytes > most {
                return Err(full(name, size_bytes, format!("{held} of the {most} bytes of `memory` are in use")));
            }
        }
        let device = &self.context.device;
        // SAFETY: `info` is complete; the buffer is destroyed in Drop.
        let raw = call("vkCreateBuffer", || unsafe { device.create_buffer(&info, None) })?;
        let mut buffer = AnyBuffer { name: name.to_owned(), memory, size_bytes, raw, allocation: None, context: self.context.clone() };
        // SAFETY: the buffer was just made.
        let requirements = unsafe { device.get_buffer_memory_requirements(raw) };
        let allocation = self.allocate(name, size_bytes, memory, requirements)?;
        // SAFETY: memory and offset come from the allocator for these requirements, and the allocation is
        // freed after the buffer.
        call("vkBindBufferMemory", || unsafe { device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) })?;
        buffer.allocation = Some(allocation);
        self.context.held().take(memory, size_bytes);
        self.context.set_name(raw, name);
        Ok(Buffer { any: buffer, element: PhantomData })
    }

    fn allocate(&self, name: &str, size_bytes: u64, memory: Memory, requirements: vk::MemoryRequirements) -> Result<Allocation> {
        let mut allocator = self.context.allocator();
        let location = match memory {
            Memory::Device => MemoryLocation::GpuOnly,
            Memory::Upload => MemoryLocation::CpuToGpu,
            Memory::ReadBack => MemoryLocation::GpuToCpu,
        };
        let allocation_scheme = AllocationScheme::GpuAllocatorManaged;
        let wanted = AllocationCreateDesc { name, requirements, location, linear: true, allocation_scheme };
        if faults::planted(ALLOCATION).is_err() {
            return Err(full(name, size_bytes, "the memory is full".to_owned()));
        }
        allocator.as_mut().expect("the allocator lives as long as the device").allocate(&wanted).map_err(|error| match error {
            AllocationError::OutOfMemory => full(name, size_bytes, "the memory is full".to_owned()),
            error => Error::Device { call: ALLOCATION, reason: format!("{size_bytes} bytes for {name}: {error}") },
        })
    }

    /// What buffers take by the sizes that were asked for; an allocator rounds them up.
    pub(crate) fn held_memory(&self) -> HeldMemory {
        *self.context.held()
    }

    /// Peaks begin anew at what is held now.
    pub fn forget_peaks(&self) {
        let mut held = self.context.held();
        (held.peak_device_bytes, held.peak_staging_bytes) = (held.device_bytes, held.staging_bytes);
    }

    /// Work whose memory is no run's: peaks stay what they were.
    pub(super) fn without_peaks<T>(&self, work: impl FnOnce() -> T) -> T {
        let HeldMemory { peak_device_bytes, peak_staging_bytes, .. } = self.held_memory();
        let result = work();
        let mut held = self.context.held();
        (held.peak_device_bytes, held.peak_staging_bytes) = (peak_device_bytes, peak_staging_bytes);
        result
    }
}

impl<T> Buffer<T> {
    pub(crate) fn any(&self) -> &AnyBuffer {
        &self.any
    }

    /// Elements that it has room for.
    pub(crate) fn count(&self) -> u64 {
        self.any.size_bytes / size_of::<T>() as u64
    }

    pub(super) fn into_any(self) -> AnyBuffer {
        self.any
    }

    pub(super) fn mapped(&self) -> &[u8] {
        let allocation = self.any.allocation.as_ref().expect("bound at creation");
        &allocation.mapped_slice().expect("the host maps upload and read-back buffers")[..self.any.size_bytes as usize]
    }

    pub(super) fn mapped_mut(&mut self) -> &mut [u8] {
        let size_bytes = self.any.size_bytes as usize;
        let allocation = self.any.allocation.as_mut().expect("bound at creation");
        &mut allocation.mapped_slice_mut().expect("the host maps upload and read-back buffers")[..size_bytes]
    }
}

impl AnyBuffer {
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn raw(&self) -> vk::Buffer {
        self.raw
    }
}

impl Drop for AnyBuffer {
    fn drop(&mut self) {
        // SAFETY: commands wait for the device before they return, so nothing uses the buffer.
        unsafe { self.context.device.destroy_buffer(self.raw, None) };
        if let (Some(allocation), Some(allocator)) = (self.allocation.take(), self.context.allocator().as_mut()) {
            // Freeing fails only for memory of another allocator.
            let _ = allocator.free(allocation);
            self.context.held().give_back(self.memory, self.size_bytes);
        }
    }
}
