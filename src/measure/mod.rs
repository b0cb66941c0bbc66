//! What photonmill costs: benchmarks, builders compared, accuracy against time, and the paper's tables.

pub mod bench;
pub mod compaction;
pub mod interval;
pub mod line_fit;
pub mod paper;
pub mod study;
