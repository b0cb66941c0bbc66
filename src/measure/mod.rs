//! What photonmill costs: benchmarks, builders compared, accuracy against time, pictures to show, and the paper's tables.

pub(crate) mod bench;
pub(crate) mod compaction;
pub(crate) mod gallery;
pub(crate) mod interval;
pub(crate) mod line_fit;
pub(crate) mod paper;
pub mod study;
