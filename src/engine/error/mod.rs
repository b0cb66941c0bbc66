//! How far a result may be from the truth: what its blocks, hits and samples tell of the noise, what smaller radii tell of the bias, and
//! the bound of both.

pub mod bias;
pub mod bias_batches;
pub mod bound;
pub mod degrees_of_freedom;
pub mod differences;
pub mod measure;
pub mod unknown;
