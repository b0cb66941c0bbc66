//! Barriers: one memory barrier before a command that conflicts with an earlier one.

use std::collections::HashSet;

use ash::vk;

use super::Commands;
use crate::gpu::AnyBuffer;

/// A buffer that a command touches, and whether it reads and writes it.
pub(super) type Access<'a> = (&'a AnyBuffer, bool, bool);

/// What happened to buffers since the last barrier.
#[derive(Default)]
pub(super) struct Hazards {
    read: HashSet<vk::Buffer>,
    written: HashSet<vk::Buffer>,
}

impl Hazards {
    /// Whether a command reads what an earlier one wrote, or writes what an earlier one read or wrote.
    pub(super) fn conflict(&self, accesses: &[Access]) -> bool {
        accesses.iter().any(|(buffer, _, writes)| self.written.contains(&buffer.raw()) || (*writes && self.read.contains(&buffer.raw())))
    }

    pub(super) fn add(&mut self, accesses: &[Access]) {
        for (buffer, reads, writes) in accesses {
            if *reads {
                self.read.insert(buffer.raw());
            }
            if *writes {
                self.written.insert(buffer.raw());
            }
        }
    }
}

impl Commands<'_> {
    /// Waits, if it must, before a command that touches this.
    pub(super) fn order(&mut self, accesses: &[Access]) {
        if self.hazards.conflict(accesses) {
            self.barrier();
        }
        self.hazards.add(accesses);
    }

    pub(super) fn barrier(&mut self) {
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

    pub(super) fn record_barrier(&self, barrier: vk::MemoryBarrier2) {
        let barriers = [barrier];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is recording.
        unsafe { self.gpu.context.device.cmd_pipeline_barrier2(self.command_buffer, &dependency) };
    }
}
