//! What commands touch between two barriers, and which of them must wait.

use std::collections::HashSet;

use ash::vk;

use super::AnyBuffer;

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
