//! What photonmill costs: benchmarks, builders compared, accuracy against time, pictures to show, and the paper's tables.

pub mod bench;
pub mod compaction;
pub mod gallery;
pub mod interval;
pub mod line_fit;
pub mod paper;
pub mod study;
