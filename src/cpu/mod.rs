//! The builder that the paper calls the CPU implementation: the modified algorithm, on one thread as
//! in the paper or on many, with the same stages as on the GPU. Its functions are the twins of the
//! GLSL ones, operation by operation in f32, and judge them in tests. Two stages go their own way to the same
//! bits: [`trace`] takes a block of photons from emission to their end, and [`splat`] needs no index.

pub(crate) mod bsdf;
pub(crate) mod emission;
pub(crate) mod estimate;
pub(crate) mod math;
pub(crate) mod nearest;
pub(crate) mod room;
pub(crate) mod sampling;
pub(crate) mod splat;
pub(crate) mod trace;
pub(crate) mod tree;
