//! How far a result may be from the truth: what its blocks, hits and samples say of the noise, what smaller radii say of the bias, and
//! the bound of both.

pub mod bias;
pub(crate) mod bias_batches;
pub mod bound;
pub(crate) mod degrees_of_freedom;
pub(crate) mod differences;
pub(crate) mod measure;
pub(crate) mod unknown;
