//! The engine: from a plan to light. Both worlds, the paper's box ([`room`]) and scenes of triangles ([`scene`]), trace photons,
//! index them, and estimate densities with the kernels of `glsl` (or, of the box, their twins in `cpu`); what stands beside them here is the same for both.

pub mod bias;
pub mod bias_batches;
pub mod blocks;
pub mod choose_builder;
pub mod degrees_of_freedom;
pub mod differences;
pub mod error_bound;
pub mod film;
pub mod identity;
pub mod measure_of_error;
pub mod nonfinite_values;
pub mod planned;
pub mod prefix_sum;
pub mod replay;
pub mod retry;
pub mod room;
pub mod run;
pub mod saved;
pub mod scene;
pub mod several_devices;
pub mod tallies;
pub mod totals;
pub mod unknown;
pub mod watch;

pub use watch::{Control, End, Progress};

use crate::gpu::DeviceFacts;
use crate::plan::Limits;

/// What the plan may use of a device.
pub fn limits(facts: &DeviceFacts) -> Limits {
    Limits {
        buffer_bytes: facts.storage_buffer_range_bytes.min(facts.allocation_bytes),
        memory_bytes: facts.usable_memory_bytes,
        group_size: facts.work_group_size,
        votes_in_loops: facts.votes_in_loops,
        ..Limits::of_kind(facts.kind)
    }
}
