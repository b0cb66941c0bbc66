//! The engine: from a plan to light. Both worlds, the paper's box ([`room`]) and scenes of triangles ([`scene`]), trace photons,
//! index them, and estimate densities with the kernels of `glsl` (or, of the box, their twins in `cpu`); what stands beside them here is the same for both.

pub(crate) mod choose_builder;
pub mod error;
pub mod film;
pub(crate) mod nonfinite_values;
pub(crate) mod planned;
pub(crate) mod prefix_sum;
pub(crate) mod replay;
pub mod room;
pub mod run;
pub mod scene;
pub(crate) mod tallies;
pub(crate) mod totals;

pub(crate) use run::watch::Control;
pub use run::watch::{End, Progress};

use crate::gpu::DeviceFacts;
use crate::plan::Limits;

/// What the plan may use of a device.
pub(crate) fn limits(facts: &DeviceFacts) -> Limits {
    Limits {
        buffer_bytes: facts.storage_buffer_range_bytes.min(facts.allocation_bytes),
        memory_bytes: facts.usable_memory_bytes,
        group_size: facts.work_group_size,
        votes_in_loops: facts.votes_in_loops,
        ..Limits::of_kind(facts.kind)
    }
}
