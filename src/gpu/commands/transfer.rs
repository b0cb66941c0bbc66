//! What comes into buffers, and out of them, without a kernel.

use ash::vk;
use bytemuck::Pod;

use super::Commands;
use crate::error::Result;
use crate::gpu::{Buffer, Memory};
use crate::timings::Handled;

/// Elements on their way to the host.
#[must_use]
pub(crate) struct ReadBack<T>(Option<Buffer<T>>);

impl<T: Pod> ReadBack<T> {
    /// The elements, once the commands that copy them have run.
    pub(crate) fn take(self) -> Vec<T> {
        self.0.map_or_else(Vec::new, |buffer| bytemuck::pod_collect_to_vec(buffer.mapped()))
    }
}

impl Commands<'_> {
    /// Sets every 32-bit word of `count` elements of a buffer, from element `first` on.
    pub(crate) fn fill<T>(&mut self, buffer: &Buffer<T>, first: u64, count: u64, word: u32) {
        self.order(&[(buffer.any(), false, true)]);
        assert!(first + count <= buffer.count(), "{}: elements {first} to {}", buffer.any().name(), first + count);
        let element = size_of::<T>() as u64;
        let (device, raw) = (&self.gpu.context.device, buffer.any().raw());
        // SAFETY: the buffer outlives the submission; the range is inside it.
        unsafe { device.cmd_fill_buffer(self.command_buffer, raw, element * first, element * count, word) };
        self.count_bytes(element * count);
    }

    /// Sets all of a buffer to zero.
    pub(crate) fn clear<T>(&mut self, buffer: &Buffer<T>) {
        self.fill(buffer, 0, buffer.count(), 0);
    }

    /// Copies host data to the start of a buffer.
    pub(crate) fn upload<T: Pod>(&mut self, buffer: &Buffer<T>, content: &[T]) -> Result<()> {
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

    /// A buffer on the device with this content.
    pub(crate) fn uploaded<T: Pod>(&mut self, name: &str, content: &[T]) -> Result<Buffer<T>> {
        let buffer = self.gpu.buffer(name, content.len() as u64, Memory::Device)?;
        self.upload(&buffer, content)?;
        Ok(buffer)
    }

    /// Copies the first `count` elements of a buffer into another.
    pub(crate) fn copy<T>(&mut self, from: &Buffer<T>, to: &Buffer<T>, count: u64) {
        for buffer in [from, to] {
            assert!(count <= buffer.count(), "{}: {count} elements of {}", buffer.any().name(), buffer.count());
        }
        let (from, to) = (from.any(), to.any());
        self.order(&[(from, true, false), (to, false, true)]);
        let bytes = count * size_of::<T>() as u64;
        let region = [vk::BufferCopy::default().size(bytes)];
        // SAFETY: both buffers outlive the submission and hold so many elements.
        unsafe { self.gpu.context.device.cmd_copy_buffer(self.command_buffer, from.raw(), to.raw(), &region) };
        self.count_bytes(2 * bytes);
    }

    /// Runs everything recorded so far and returns the first `count` elements of a buffer.
    pub(crate) fn read<T: Pod>(&mut self, buffer: &Buffer<T>, count: usize) -> Result<Vec<T>> {
        let read_back = self.copy_out(buffer, count)?;
        self.submit()?;
        Ok(read_back.take())
    }

    /// Records a copy of the first `count` elements of a buffer to the host; after the next submission they can be taken.
    pub(crate) fn copy_out<T: Pod>(&mut self, buffer: &Buffer<T>, count: usize) -> Result<ReadBack<T>> {
        if count == 0 {
            return Ok(ReadBack(None));
        }
        let read_back = self.gpu.buffer::<T>("read back", count as u64, Memory::ReadBack)?;
        self.copy(buffer, &read_back, count as u64);
        Ok(ReadBack(Some(read_back)))
    }

    fn count_bytes(&mut self, bytes: u64) {
        self.count(Handled { bytes, ..Handled::default() });
    }
}
