//! What is known without the engine, and the engine held against it: a path tracer that shares nothing with it, closed forms,
//! radiosity; and any picture against another one.

#[cfg(any(feature = "program", feature = "lab"))]
pub mod compare;
pub mod judge;
pub mod selfcheck;
